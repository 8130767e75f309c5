// Method:     Green's theorem with j_l Y_lm. Y_lm as polynomials in the unit vector: q_lm(z) Re or Im (x + i y)^m, q_lm the normalised
//   derivatives of Legendre polynomials, so gradients are regular at the poles. Midpoints in runs; all fields at once. j_l by downward
//   recurrence from a continued fraction (Lentz), h_l by upward ratios h_l / h_{l-1}.
// Source:     docs/equations.md E10; Morse & Ingard, Theoretical Acoustics (1968), 7.2.
#include "precompute/air/expansion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/base/hankel.hpp"

namespace carillon::air {
namespace {

using Complex = std::complex<double>;

/// j_l / j_{l-1} at x > 0.
double calc_bessel_ratio(double x, int l) {
  // Continued fraction (2l+1)/x - 1 / ((2l+3)/x - ...); the ratio is its inverse.
  constexpr double kTiny = 1e-300;
  double f = (2 * l + 1) / x, c = f, d = 0.0;
  for (int n = 1; n < 100000; ++n) {
    const double b = (2 * (l + n) + 1) / x;
    d = b - d;
    c = b - 1.0 / c;
    if (d == 0.0) d = kTiny;
    if (c == 0.0) c = kTiny;
    d = 1.0 / d;
    const double change = c * d;
    f *= change;
    if (std::abs(change - 1.0) < 1e-16) break;
  }
  return 1.0 / f;
}

/// Ratios h_l / h_{l-1}, l = 1 .. order, at [l].
std::vector<Complex> calc_hankel_ratios(double x, int order) {
  std::vector<Complex> ratio = base::calc_hankel_quotients(x, order);
  for (Complex& one : ratio) one = 1.0 / one;
  return ratio;
}

/// Harmonics of one unit vector, with derivatives by its three components as independent variables.
class Harmonics {
 public:
  explicit Harmonics(int order) : order_(order), a_(count()), b_(count()), value_(count()), cosine_(size()), sine_(size()) {
    for (int m = 0; m <= order + 1; ++m)
      for (int l = m; l <= order + 1; ++l) {
        const double m2 = static_cast<double>(m) * m, l1 = l + 1.0;
        a_[at(l, m)] = std::sqrt((4.0 * l1 * l1 - 1.0) / (l1 * l1 - m2));
        b_[at(l, m)] = l == m ? 0.0 : std::sqrt((static_cast<double>(l) * l - m2) / (4.0 * l * l - 1.0));
      }
  }

  void set(const Vec3& u) {
    double diagonal = std::sqrt(0.25 / std::numbers::pi);
    cosine_[0] = 1.0;
    sine_[0] = 0.0;
    for (int m = 0; m <= order_ + 1; ++m) {
      double before = 0.0, here = diagonal;
      for (int l = m; l <= order_ + 1; ++l) {
        value_[at(l, m)] = here;
        const double next = a_[at(l, m)] * (u[2] * here - b_[at(l, m)] * before);
        before = here;
        here = next;
      }
      diagonal *= std::sqrt((2.0 * m + 3.0) / (2.0 * m + 2.0));
      const std::size_t i = m;
      if (m <= order_) {
        cosine_[i + 1] = u[0] * cosine_[i] - u[1] * sine_[i];
        sine_[i + 1] = u[1] * cosine_[i] + u[0] * sine_[i];
      }
    }
  }

  /// Y_lm for m >= 0 (cosine) and -m (sine), with gradients.
  void find(int l, int m, double& even, double& odd, Vec3& even_slope, Vec3& odd_slope) const {
    const double scale = m == 0 ? 1.0 : std::numbers::sqrt2, q = scale * value_[at(l, m)];
    // The derivative of q_lm is q_l,m+1 times this factor.
    const double slope = scale * (m < l ? value_[at(l, m + 1)] * std::sqrt((l - m) * (l + m + 1.0)) : 0.0);
    const std::size_t i = m;
    even = q * cosine_[i];
    odd = q * sine_[i];
    const double c = m > 0 ? m * cosine_[i - 1] : 0.0, s = m > 0 ? m * sine_[i - 1] : 0.0;
    even_slope = {q * c, -q * s, slope * cosine_[i]};
    odd_slope = {q * s, q * c, slope * sine_[i]};
  }

 private:
  std::size_t size() const { return static_cast<std::size_t>(order_) + 2; }
  std::size_t count() const { return size() * size(); }
  std::size_t at(int l, int m) const { return static_cast<std::size_t>(m) * size() + static_cast<std::size_t>(l); }
  int order_;
  std::vector<double> a_, b_, value_, cosine_, sine_;
};

/// Regular waves about the centre and their flux through a surface element, (harmonics, points).
struct Waves {
  std::vector<double> value, flow;
};

}  // namespace

std::vector<double> calc_bessel(double x, int order) {
  std::vector<double> j(order + 1);
  if (!(x > 0.0)) {
    j[0] = 1.0;
    return j;
  }
  // Downward ratios are stable for every l; j_0 fixes the scale, or j_1 near a zero of j_0.
  std::vector<double> ratio(order + 2);
  ratio[order + 1] = calc_bessel_ratio(x, order + 1);
  std::vector<double> down(order + 1);
  double here = 1.0, above = ratio[order + 1];
  for (int l = order; l >= 0; --l) {
    down[l] = here;
    const double below = (2 * l + 1) / x * here - above;
    above = here;
    here = below;
    if (std::abs(here) > 1e200) {
      for (int i = l; i <= order; ++i) down[i] *= 1e-200;
      here *= 1e-200;
      above *= 1e-200;
    }
  }
  const double j0 = x < 1e-4 ? 1.0 - x * x / 6.0 : std::sin(x) / x;
  const double j1 = x < 1e-2 ? x / 3.0 * (1.0 - x * x / 10.0 * (1.0 - x * x / 28.0)) : (std::sin(x) / x - std::cos(x)) / x;
  const bool by_second = order > 0 && std::abs(j1) > std::abs(j0);
  const double factor = by_second ? j1 / down[1] : j0 / down[0];
  for (std::size_t l = 0; l < j.size(); ++l) j[l] = down[l] * factor;
  return j;
}

std::vector<double> calc_log_hankel(double x, int order) {
  const std::vector<Complex> ratio = calc_hankel_ratios(x, order);
  std::vector<double> logs{-std::log(x)};
  for (std::size_t l = 1; l < ratio.size(); ++l) logs.push_back(logs.back() + std::log(std::abs(ratio[l])));
  return logs;
}

Spread calc_spread(double k, double radius_m, double nearest_m, int order) {
  const std::vector<double> here = calc_log_hankel(k * radius_m, order), there = calc_log_hankel(k * nearest_m, order);
  Spread spread;
  for (std::size_t l = 0; l < here.size(); ++l) {
    spread.near.push_back(std::exp(2.0 * (there[l] - here[l])));
    spread.far.push_back(std::exp(2.0 * (here[0] - here[l])));
  }
  return spread;
}

std::vector<Complex> calc_hankel_phase(double x, int order) {
  const std::vector<Complex> ratio = calc_hankel_ratios(x, order);
  std::vector<Complex> phase{Complex(std::sin(x), -std::cos(x))};  // h_0 = - i e^{ix} / x
  for (std::size_t l = 1; l < ratio.size(); ++l) {
    phase.push_back(phase.back() * ratio[l] / std::abs(ratio[l]));
    phase.back() /= std::abs(phase.back());
  }
  return phase;
}

std::vector<Complex> calc_expansion(const RadiatingSurface& surface, const Sphere& sphere, double k, int order,
                                    std::span<const std::complex<float>> pressure, std::span<const float> velocity, std::size_t count,
                                    std::span<const std::int32_t> sides) {
  constexpr std::size_t kRun = 128;
  const std::size_t fields = sides.size(), harmonics = count_harmonics(order), points = surface.count_points();
  std::vector<Vec3> flow_area(points);  // sum of normal times a third of the area
  std::vector<float> source(points * fields);
  for (std::size_t t = 0; t < surface.count_facets(); ++t) {
    const Facet& facet = surface.get_facets()[t];
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t p = facet.points[c];
      flow_area[p] = flow_area[p] + (facet.area_m2 / 3.0) * facet.normal;
      const float *a = &velocity[(t * 3 + (c + 1) % 3) * count], *b = &velocity[(t * 3 + (c + 2) % 3) * count];
      for (std::size_t m = 0; m < fields; ++m)
        source[p * fields + m] += static_cast<float>(facet.area_m2 / 6.0) * (a[sides[m]] + b[sides[m]]);
    }
  }
  std::vector<double> re(harmonics * fields), im(harmonics * fields);
  Harmonics find(order);
  Waves waves{std::vector<double>(harmonics * kRun), std::vector<double>(harmonics * kRun)};
  std::vector<double> p_re(kRun * fields), p_im(kRun * fields), v(kRun * fields);
  for (std::size_t first = 0; first < points; first += kRun) {
    const std::size_t run = std::min(kRun, points - first);
    for (std::size_t i = 0; i < run; ++i) {
      const EdgePoint& point = surface.get_points()[first + i];
      const Vec3 offset = point.place_m - sphere.centre_m, area = flow_area[first + i];
      const double r = norm(offset);
      const Vec3 u = r > 0.0 ? (1.0 / r) * offset : Vec3{0, 0, 1};
      const std::vector<double> j = calc_bessel(k * r, order + 1);
      const double per_r = r > 0.0 ? 1.0 / r : 0.0;
      find.set(u);
      const double radial = dot(u, area);
      for (int l = 0; l <= order; ++l) {
        const std::size_t at = l;
        // j_l' = l / x j_l - j_{l+1}; at the centre only l = 1 has a slope, 1/3 along the axis of Y_1m
        const double slope = r > 0.0 ? l * per_r * j[at] - k * j[at + 1] : l == 1 ? k / 3.0 : 0.0;
        const double turn = r > 0.0 ? per_r * j[at] : l == 1 ? k / 3.0 : 0.0;
        for (int m = 0; m <= l; ++m) {
          double even, odd;
          Vec3 even_slope, odd_slope;
          find.find(l, m, even, odd, even_slope, odd_slope);
          const auto flow = [&](double y, const Vec3& g) { return slope * y * radial + turn * (dot(g, area) - dot(g, u) * radial); };
          const std::size_t base = at * at + at, up = (base + static_cast<std::size_t>(m)) * kRun + i;
          waves.value[up] = j[at] * even;
          waves.flow[up] = flow(even, even_slope);
          if (m == 0) continue;
          const std::size_t down = (base - static_cast<std::size_t>(m)) * kRun + i;
          waves.value[down] = j[at] * odd;
          waves.flow[down] = flow(odd, odd_slope);
        }
      }
      for (std::size_t m = 0; m < fields; ++m) {
        const auto [a, b] = point.nodes;
        const std::complex<float> mean =
            0.5F * (pressure[static_cast<std::size_t>(a) * fields + m] + pressure[static_cast<std::size_t>(b) * fields + m]);
        p_re[m * kRun + i] = mean.real();
        p_im[m * kRun + i] = mean.imag();
        v[m * kRun + i] = source[(first + i) * fields + m];
      }
    }
    for (std::size_t h = 0; h < harmonics; ++h) {
      const double *value = &waves.value[h * kRun], *flow = &waves.flow[h * kRun];
      for (std::size_t m = 0; m < fields; ++m) {
        const double *a = &p_re[m * kRun], *b = &p_im[m * kRun], *w = &v[m * kRun];
        double sum_re = 0.0, sum_im = 0.0;
        for (std::size_t i = 0; i < run; ++i) {
          sum_re += a[i] * flow[i] - w[i] * value[i];
          sum_im += b[i] * flow[i];
        }
        re[m * harmonics + h] += sum_re;
        im[m * harmonics + h] += sum_im;
      }
    }
  }
  std::vector<Complex> expansion(fields * harmonics);
  for (std::size_t i = 0; i < expansion.size(); ++i) expansion[i] = Complex(0.0, k) * Complex(re[i], im[i]);
  return expansion;
}

}  // namespace carillon::air

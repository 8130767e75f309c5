// Method:     the response of a mode to a force f during one sample is the integral of E(1 - u) f(u), E the mode's impulse response. E is a
//             short Chebyshev series, computed once per mode; then only the moments of f against the Chebyshev polynomials are needed, the
//             same for all modes. Moments are Gauss-Legendre sums in theta with x = (1 - cos theta) / 2, which makes the root singularity
//             of sin^1.5 at both ends smooth; near one end only, in s with x = s^2 from it, at a third of the sines; inside a pulse, and
//             for the Gaussian, in time itself.
// Source:     pulse shapes: Hunt & Crossley 1975; OSG02 section 4. Product integration: Davis & Rabinowitz, Methods of Numerical
//             Integration, 2.5.6.
// Deviations: OSG02's Gaussian is infinite; here it is cut at four standard deviations, without 6e-5 of its area, and rescaled.
#include "runtime/synth/pulse.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace carillon::synth {
namespace {

using std::numbers::pi;

// 1 / integral of sin(pi x)^1.5 over 0 <= x <= 1 = sqrt(pi) Gamma(7/4) / Gamma(5/4).
const double kPulseNorm = std::sqrt(pi) * std::tgamma(1.75) / std::tgamma(1.25);

// Standard deviation of the Hertz pulse of length 1.
const double kDeviation = [] {
  // Trapezium rule in theta, x - 1/2 = -cos(theta) / 2: the integrand is smooth and periodic.
  double area = 0.0, square = 0.0;
  for (int i = 1; i < 4096; ++i) {
    const double theta = pi * i / 4096.0, x = -0.5 * std::cos(theta);
    const double force = std::pow(std::sin(pi * (x + 0.5)), 1.5) * std::sin(theta);
    area += force;
    square += force * x * x;
  }
  return std::sqrt(square / area);
}();
constexpr double kCut = 4.0;
const double kGaussNorm = 2.0 * kCut / (std::sqrt(2.0 * pi) * std::erf(kCut / std::numbers::sqrt2));

/// Gauss-Legendre on 0..1.
template <int kPoints>
struct GaussRule {
  std::array<double, kPoints> node{};    // in 0..1
  std::array<double, kPoints> weight{};  // sums to 1

  /// By Newton's method on the Legendre polynomial.
  GaussRule() {
    for (int i = 0; i < kPoints; ++i) {
      double x = std::cos(pi * (i + 0.75) / (kPoints + 0.5));
      double slope = 1.0;
      for (int iteration = 0; iteration < 20; ++iteration) {
        double p = 1.0, previous = 0.0;
        for (int n = 0; n < kPoints; ++n) {
          const double next = ((2.0 * n + 1.0) * x * p - n * previous) / (n + 1.0);
          previous = p;
          p = next;
        }
        slope = kPoints * (x * p - previous) / (x * x - 1.0);
        x -= p / slope;
      }
      node[i] = 0.5 * (1.0 + x);
      weight[i] = 1.0 / ((1.0 - x * x) * slope * slope);
    }
  }
};

const GaussRule<24> kRule;    // both ends of the pulse in or near the interval
const GaussRule<16> kEnd;     // one end
const GaussRule<12> kInside;  // inside a pulse
constexpr double kShortest = 1e-9;
constexpr double kLong = 3.0;  // intervals
constexpr double kGaussLong = 8.0;
constexpr double kNearEnd = 1.0;  // minimum distance of an end from an interval integrated in time
constexpr double kFarEnd = 0.75;  // minimum distance of the other end

/// sin(pi x) = 4 x (1 - x) P((x - 1/2)^2) for 0 <= x <= 1, relative error 1e-14, branch-free: P is the series of the cosine over 1 - 4 z.
constexpr std::array<double, 10> kSine = [] {
  std::array<double, 10> p{};
  double term = 1.0, sum = 0.0, power = 1.0;  // of the series of the cosine at z = 1/4
  for (std::size_t k = 0; k < p.size(); ++k) {
    sum += term;
    p[k] = power * sum;
    power *= 4.0;
    const double n = 2.0 * static_cast<double>(k);
    term *= -pi * pi / 4.0 / ((n + 1.0) * (n + 2.0));
  }
  return p;
}();

double calc_sine(double x) {
  const double z = (x - 0.5) * (x - 0.5);
  double p = kSine.back();
  for (std::size_t k = kSine.size() - 1; k-- > 0;) p = p * z + kSine[k];
  return 4.0 * x * (1.0 - x) * p;
}

/// Sums of weight T_j(2 u - 1) over points of one interval, all points per step of j.
template <std::size_t kPoints>
Moments calc_sums(const std::array<double, kPoints>& u, const std::array<double, kPoints>& weight) {
  Moments moments{};
  std::array<double, kPoints> twice_x, before, now;
  for (std::size_t i = 0; i < kPoints; ++i) {
    before[i] = weight[i];
    now[i] = weight[i] * (2.0 * u[i] - 1.0);
    twice_x[i] = 4.0 * u[i] - 2.0;
    moments[0] += before[i];
    moments[1] += now[i];
  }
  for (std::size_t j = 2; j < kMoments; ++j) {
    for (std::size_t i = 0; i < kPoints; ++i) {
      const double next = twice_x[i] * now[i] - before[i];
      before[i] = now[i];
      now[i] = next;
    }
    for (const double x : now) moments[j] += x;
  }
  return moments;
}

/// Moments of a smooth density over from <= u <= to.
template <int kPoints, typename Density>
Moments calc_smooth_moments(const GaussRule<kPoints>& rule, double from, double to, Density density) {
  std::array<double, kPoints> u, weight;
  for (int i = 0; i < kPoints; ++i) {
    u[i] = from + (to - from) * rule.node[i];
    weight[i] = rule.weight[i] * (to - from) * density(u[i]);
  }
  return calc_sums(u, weight);
}

/// Near one end of the pulse, far from the other: with x = s^2 from that end the force is s^3 times a smooth function. `sign`: 1 from the
/// beginning on, -1 from the end back; the end lies at u = `origin`.
Moments calc_end_moments(double origin, double sign, double length) {
  const double near = std::max(0.0, sign > 0.0 ? -origin : origin - 1.0) / length;
  const double far = (sign > 0.0 ? 1.0 - origin : origin) / length;
  const double s_from = std::sqrt(near), s_to = std::sqrt(far);
  std::array<double, 16> u, weight;
  for (std::size_t i = 0; i < u.size(); ++i) {
    const double s = s_from + (s_to - s_from) * kEnd.node[i];
    const double force = std::max(0.0, calc_sine(s * s));  // clamps rounding beyond the end
    u[i] = origin + sign * length * s * s;
    weight[i] = kEnd.weight[i] * (s_to - s_from) * 2.0 * s * kPulseNorm * force * std::sqrt(force);
  }
  return calc_sums(u, weight);
}

Moments calc_hertz_moments(double start, double length) {
  const double end = start + length;
  if (start < -kNearEnd && end > 1.0 + kNearEnd) {
    return calc_smooth_moments(kInside, 0.0, 1.0, [&](double u) {
      const double s = calc_sine((u - start) / length);
      return kPulseNorm / length * s * std::sqrt(s);
    });
  }
  if (start < 1.0 && end > 1.0 + kFarEnd && length > kLong) return calc_end_moments(start, 1.0, length);
  if (end > 0.0 && start < -kFarEnd && length > kLong) return calc_end_moments(end, -1.0, length);
  const double from = std::clamp(-start / length, 0.0, 1.0);
  const double to = std::clamp((1.0 - start) / length, 0.0, 1.0);
  if (!(to > from)) return {};
  const double theta_from = std::acos(1.0 - 2.0 * from);
  const double theta_to = std::acos(1.0 - 2.0 * to);
  std::array<double, 24> u, weight;
  for (std::size_t i = 0; i < u.size(); ++i) {
    const double theta = theta_from + (theta_to - theta_from) * kRule.node[i];
    const double cosine = std::cos(theta);
    const double force = std::cos(0.5 * pi * cosine);  // sin(pi x)
    u[i] = start + length * 0.5 * (1.0 - cosine);
    weight[i] = kRule.weight[i] * (theta_to - theta_from) * 0.5 * std::sin(theta) * kPulseNorm * force * std::sqrt(std::max(force, 0.0));
  }
  return calc_sums(u, weight);
}

Moments calc_gauss_moments(double start, double length) {
  const double from = std::clamp(start, 0.0, 1.0), to = std::clamp(start + length, 0.0, 1.0);
  if (!(to > from)) return {};
  const auto density = [&](double u) {
    const double x = 2.0 * kCut * ((u - start) / length - 0.5);
    return kGaussNorm / length * std::exp(-0.5 * x * x);
  };
  return length > kGaussLong && from == 0.0 && to == 1.0 ? calc_smooth_moments(kInside, 0.0, 1.0, density)
                                                         : calc_smooth_moments(kRule, from, to, density);
}

}  // namespace

double calc_pulse_length(PulseShape shape, double duration) noexcept {
  return shape == PulseShape::kHertz ? duration : duration * 2.0 * kCut * kDeviation;
}

double calc_pulse(PulseShape shape, double x) noexcept {
  if (!(x > 0.0 && x < 1.0)) return 0.0;
  if (shape == PulseShape::kGaussian) {
    const double y = 2.0 * kCut * (x - 0.5);
    return kGaussNorm * std::exp(-0.5 * y * y);
  }
  const double s = std::sin(pi * x);
  return kPulseNorm * s * std::sqrt(s);
}

Moments calc_chebyshev(double u) noexcept {
  const double x = 2.0 * u - 1.0;
  Moments t{};
  t[0] = 1.0;
  t[1] = x;
  for (int j = 2; j < kMoments; ++j) t[j] = 2.0 * x * t[j - 1] - t[j - 2];
  return t;
}

Moments calc_pulse_moments(PulseShape shape, double start, double length) noexcept {
  if (length < kShortest) return start > 0.0 && start <= 1.0 ? calc_chebyshev(start) : Moments{};
  return shape == PulseShape::kHertz ? calc_hertz_moments(start, length) : calc_gauss_moments(start, length);
}

Moments calc_level_moments(double start, double length) noexcept {
  const double from = std::clamp(start, 0.0, 1.0), to = std::clamp(start + length, 0.0, 1.0);
  if (!(to > from)) return {};
  // The integral of T_j(x) is (T_{j+1}(x) / (j + 1) - T_{j-1}(x) / (j - 1)) / 2, and dx = 2 du.
  const double x = 2.0 * from - 1.0, y = 2.0 * to - 1.0;
  std::array<double, kMoments + 1> tx{1.0, x}, ty{1.0, y};
  for (std::size_t j = 2; j < tx.size(); ++j) {
    tx[j] = 2.0 * x * tx[j - 1] - tx[j - 2];
    ty[j] = 2.0 * y * ty[j - 1] - ty[j - 2];
  }
  Moments moments{};
  moments[0] = (to - from) / length;
  moments[1] = moments[0] * (from + to - 1.0);
  for (std::size_t j = 2; j < kMoments; ++j) {
    const auto n = static_cast<double>(j);
    moments[j] = 0.25 * ((ty[j + 1] - tx[j + 1]) / (n + 1.0) - (ty[j - 1] - tx[j - 1]) / (n - 1.0)) / length;
  }
  return moments;
}

std::array<double, kMoments> get_chebyshev_points() noexcept {
  std::array<double, kMoments> points{};
  for (int k = 0; k < kMoments; ++k) points[k] = 0.5 * (1.0 + std::cos(pi * (k + 0.5) / kMoments));
  return points;
}

Moments calc_chebyshev_coefficients(const std::array<double, kMoments>& values) noexcept {
  Moments coefficients{};
  for (int j = 0; j < kMoments; ++j) {
    double sum = 0.0;
    for (int k = 0; k < kMoments; ++k) sum += values[k] * std::cos(pi * j * (k + 0.5) / kMoments);
    coefficients[j] = sum * (j == 0 ? 1.0 : 2.0) / kMoments;
  }
  return coefficients;
}

}  // namespace carillon::synth

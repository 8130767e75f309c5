#include "precompute/analytic/particular_solutions.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/analytic/triangulate.hpp"
#include "precompute/la/decompositions.hpp"

namespace carillon::analytic {
namespace {

using std::numbers::pi;

constexpr int kRimPoints = 90;  // Chebyshev points per side
constexpr int kInsidePoints = 60;
constexpr double kRegular = 1e-12;  // tolerance of pi / angle from an integer
constexpr double kLimit = 1e-10;    // sine of the smallest angle that counts as zero
constexpr double kMaxWaves = 60.0;  // wave number times reach beyond which kRimPoints are too few

/// J at the orders first, first + 1, ..., (count), by Miller's downward recurrence, scaled to the library's value at the larger of the two
/// lowest.
std::vector<double> calc_bessel(double first, int count, double x) {
  std::vector<double> values(count, 0.0);
  if (x <= 0.0) return values;
  const int start = std::max(count, static_cast<int>(x)) + 40;
  double next = 0.0, now = 1e-200, zero = 0.0, one = 0.0;
  for (int k = start; k >= 0; --k) {
    if (k < count) values[k] = now;
    if (k == 1) one = now;
    if (k == 0) zero = now;
    const double before = 2.0 * (first + k) / x * now - next;
    next = now;
    now = before;
    if (std::abs(now) > 1e150) {
      now *= 1e-250;
      next *= 1e-250;
      zero *= 1e-250;
      one *= 1e-250;
      for (double& value : values) value *= 1e-250;
    }
  }
  const double j0 = std::cyl_bessel_j(first, x), j1 = std::cyl_bessel_j(first + 1.0, x);
  const double scale = std::abs(j0) > std::abs(j1) ? j0 / zero : j1 / one;
  for (double& value : values) value *= scale;
  return values;
}

/// The rank-th smallest singular value (1: the smallest) of a matrix with more rows than columns, by inverse subspace iteration: a tenth of
/// the cost of all singular values. Too large if no gap follows the small ones.
double calc_small_singular_value(const la::Matrix& a, int rank) {
  const Eigen::Index n = a.cols(), width = std::min<Eigen::Index>(n, rank + 2);
  la::Matrix r = la::calc_qr(a, 0).r, v(n, width);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (r(i, i) == 0.0) r(i, i) = 1e-300;
    for (Eigen::Index j = 0; j < width; ++j) v(i, j) = std::cos((2.0 * j + 1.0) * (i + 0.5));  // arbitrary start vectors
  }
  for (int step = 0; step < 4; ++step) {
    v = la::calc_qr(v, width).q;
    r.transpose().triangularView<Eigen::Lower>().solveInPlace(v);
    r.triangularView<Eigen::Upper>().solveInPlace(v);
  }
  v = la::calc_qr(v, width).q;
  return la::calc_svd(r * v).values(std::max<Eigen::Index>(width - rank, 0));
}

bool is_regular(double angle) {
  const double n = pi / angle;
  return std::abs(n - std::round(n)) < kRegular * n && std::round(n) >= 1.0;
}

}  // namespace

std::optional<ParticularSolutions> ParticularSolutions::make(const std::vector<Point2>& p) {
  const std::vector<double> angles = calc_angles(p);
  std::size_t corner = std::max_element(angles.begin(), angles.end()) - angles.begin();
  std::size_t singular = 0;
  for (std::size_t i = 0; i < p.size(); ++i)
    if (!is_regular(angles[i])) corner = i, ++singular;
  if (singular > 1 || (singular == 0 && angles[corner] > pi * (1.0 - 1e-9))) return std::nullopt;
  ParticularSolutions solutions;
  solutions.alpha_ = pi / angles[corner];
  const Point2 centre = p[corner], after = p[(corner + 1) % p.size()];
  const double turn = std::atan2(after[1] - centre[1], after[0] - centre[0]);
  solutions.reach_ = 0.0;
  const auto to_polar = [&](const Point2& x) -> Point2 {
    double angle = std::atan2(x[1] - centre[1], x[0] - centre[0]) - turn;
    if (angle < -1e-9) angle += 2.0 * pi;
    const double radius = std::hypot(x[0] - centre[0], x[1] - centre[1]);
    solutions.reach_ = std::max(solutions.reach_, radius);
    return {radius, angle};
  };
  for (std::size_t side = 1; side + 1 < p.size(); ++side) {
    const Point2 &a = p[(corner + side) % p.size()], &b = p[(corner + side + 1) % p.size()];
    for (int i = 0; i < kRimPoints; ++i) {
      const double part = 0.5 * (1.0 - std::cos(pi * (i + 0.5) / kRimPoints));
      solutions.rim_.push_back(to_polar({a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])}));
    }
  }
  // Interior points need no order: thinned corners of a mesh.
  double longest = 0.0;
  for (const Point2& x : p) longest = std::max(longest, std::hypot(x[0] - centre[0], x[1] - centre[1]));
  const Net net = triangulate(p, 0.08 * longest);
  const std::size_t step = std::max<std::size_t>(1, net.triangles.size() / (kInsidePoints * (p.size() - 2) / 2));
  for (std::size_t t = 0; t < net.triangles.size(); t += step) {
    const Triangle& v = net.triangles[t];
    Point2 middle{};
    for (int c = 0; c < 2; ++c) middle[c] = (net.points_m[v[0]][c] * 0.37 + net.points_m[v[1]][c] * 0.34 + net.points_m[v[2]][c] * 0.29);
    solutions.inside_.push_back(to_polar(middle));
  }
  return solutions;
}

double ParticularSolutions::calc_sine(double kappa, int rank) const {
  const double k = std::sqrt(kappa);
  // Orders up to slightly beyond k reach, where J decays faster than any power.
  const int count = static_cast<int>(std::ceil((k * reach_ + 8.0 * std::cbrt(k * reach_) + 26.0) / alpha_));
  const auto rows = static_cast<Eigen::Index>(rim_.size() + inside_.size());
  la::Matrix a(rows, count);
  // Orders k alpha with equal fractional part differ by integers if alpha is a fraction p / q: q chains.
  int q = 1;
  while (q < 64 && std::abs(q * alpha_ - std::round(q * alpha_)) > 1e-12 * q) ++q;
  const bool has_chains = q < 64;
  const int rise = static_cast<int>(std::lround(q * alpha_));
  for (Eigen::Index row = 0; row < rows; ++row) {
    const bool is_rim = static_cast<std::size_t>(row) < rim_.size();
    const auto& [radius, angle] = is_rim ? rim_[row] : inside_[static_cast<std::size_t>(row) - rim_.size()];
    const double x = k * radius;
    for (int chain = 1; chain <= (has_chains ? std::min(q, count) : count); ++chain) {
      const double order = chain * alpha_, first = order - std::floor(order + 1e-9);
      const int skip = static_cast<int>(std::floor(order + 1e-9)), members = has_chains ? (count - chain) / q + 1 : 1;
      const std::vector<double> values = calc_bessel(std::max(first, 0.0), skip + (members - 1) * rise + 2, x);
      for (int i = 0; i < members; ++i) {
        const int n = chain + i * q;
        a(row, n - 1) = values[skip + i * rise] * std::sin(n * alpha_ * angle);
      }
    }
  }
  for (int c = 0; c < count; ++c) {
    const double norm = a.col(c).norm();
    if (norm > 0.0) a.col(c) /= norm;
  }
  const la::Matrix basis = la::calc_qr(a, count).q;
  // Singular values of the rim part are sines of the angles; the small ones keep full precision.
  return calc_small_singular_value(basis.topRows(static_cast<Eigen::Index>(rim_.size())), rank);
}

std::optional<ParticularSolutions::Refined> ParticularSolutions::refine(double kappa, double error, int multiplicity) const {
  if (std::sqrt(kappa) * reach_ > kMaxWaves) return std::nullopt;
  // The sine falls to zero like a V: the intersection of the two lines is the next estimate, with an error of second order.
  double centre = kappa, width = std::max(error, 1e-9) * kappa;
  Refined refined{kappa, error, 1.0};
  for (int round = 0; round < 8; ++round) {
    const double low = centre - width, high = centre + width;
    const double at_low = calc_sine(low, multiplicity), at_high = calc_sine(high, multiplicity);
    const double meet = (low * at_high + high * at_low) / (at_low + at_high), there = calc_sine(meet, multiplicity);
    if (!(there < 0.9 * std::min(at_low, at_high))) {
      if (round == 0) return std::nullopt;  // not V-shaped
      break;
    }
    const double slope = (at_low + at_high) / (high - low);
    refined = {meet, 0.0, there};
    refined.error = std::max(there / slope / meet, 5e-15);
    if (there / slope < 4e-15 * meet || width < 1e-13 * meet) break;
    centre = meet;
    width = std::max(4.0 * there / slope, 2e-14 * meet);
  }
  return refined.sine < kLimit ? std::optional(refined) : std::nullopt;
}

}  // namespace carillon::analytic

#include "precompute/analytic/polygon.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/analytic/particular_solutions.hpp"
#include "precompute/analytic/triangulate.hpp"
#include "runtime/base/error.hpp"

namespace carillon::analytic {
namespace {

using std::numbers::pi;

constexpr double kMaxWanted = 20000;         // modes: takes hours
constexpr std::size_t kMaxElements = 60000;  // 18 GB; enough for kMaxWanted modes of a polygon that is not narrow
constexpr double kSlow = 4.0;                // error ratio of the last two orders at a singular corner, at most 5
constexpr double kMinError = 1e-12;          // relative, of the eigensolver
constexpr double kDegenerate = 1e-7;         // relative distance of eigenvalues that may be equal
constexpr int kMaxRefined = 200;             // modes: beyond, refinement costs more than the elements

bool is_singular(double angle) {
  const double n = pi / angle;
  return std::abs(n - std::round(n)) > 1e-9 * n || n < 0.75;
}

/// Rings of elements that reduce a corner's error in an eigenvalue to corner_error: the contribution of r^alpha in an element of size h is
/// about c^2 (k h)^(2 alpha) / p^(4 alpha) (Babuska and Suri 1987), c the distance of alpha from the next regular exponent.
int count_rings(double angle, double k_h, const PolygonSetting& setting) {
  const double alpha = pi / angle, distance = alpha - std::max(1.0, std::round(alpha));
  const double left = square(distance) * std::pow(k_h / square(setting.order), 2.0 * alpha);
  return std::max(0, static_cast<int>(std::ceil(std::log(setting.corner_error / left) / (2.0 * alpha * std::log(setting.ratio)))));
}

}  // namespace

Polygon::Polygon(const job::MembraneBody& body, const material::Material& material, const PolygonSetting& setting)
    : corners_m_(body.corners_m), side_m_(body.side_m), setting_(setting), basis_(setting.order) {
  const auto [per_area, thickness] = find_sheet(body, material);
  density_kg_m2_ = per_area;
  thickness_m_ = thickness;
  tension_n_m_ = body.tension_n_m;
  lowest_hz_ = body.lowest_hz;
  if (side_m_ > 0.0) {
    const double s = side_m_;
    corners_m_ = {{0, 0}, {2 * s, 0}, {2 * s, s}, {s, s}, {s, 2 * s}, {0, 2 * s}};
  }
  Point2 low = corners_m_[0], high = low;
  for (std::size_t i = 0; i < corners_m_.size(); ++i) {
    const Point2 &a = corners_m_[i], &b = corners_m_[(i + 1) % corners_m_.size()];
    area_m2_ += 0.5 * (a[0] * b[1] - a[1] * b[0]);
    rim_m_ += std::hypot(b[0] - a[0], b[1] - a[1]);
    for (int c = 0; c < 2; ++c) low[c] = std::min(low[c], a[c]), high[c] = std::max(high[c], a[c]);
  }
  longest_m_ = std::max(high[0] - low[0], high[1] - low[1]);
  theory = fmt::format("{} membrane, fixed along its rim", side_m_ > 0.0 ? "L-shaped" : "polygonal");
  set_rigid(density_kg_m2_);
}

Net Polygon::make_elements(double k, double edge_m) const {
  const std::vector<double> angles = calc_angles(corners_m_);
  std::vector<bool> singular;
  for (std::size_t c = 0; c < angles.size(); ++c) {
    // Elements are no longer than the sides that meet at a corner. A corner that needs no rings at that size (nearly round polygons) is not
    // singular.
    const Point2 &before = corners_m_[(c + angles.size() - 1) % angles.size()], &at = corners_m_[c],
                 &after = corners_m_[(c + 1) % angles.size()];
    const double side =
        std::min({edge_m, std::hypot(before[0] - at[0], before[1] - at[1]), std::hypot(after[0] - at[0], after[1] - at[1])});
    singular.push_back(is_singular(angles[c]) && count_rings(angles[c], k * side, setting_) > 0);
  }
  Net net = triangulate(corners_m_, edge_m, singular, kMaxElements);  // a triangle with two singular corners cannot be graded towards both
  std::vector<double> longest(corners_m_.size(), 0.0);
  for (const Triangle& t : net.triangles)
    for (int c = 0; c < 3; ++c) {
      const std::size_t corner = t[c];
      if (corner >= corners_m_.size()) continue;
      for (int other = 0; other < 3; ++other) {
        const Point2 &a = net.points_m[corner], &b = net.points_m[t[other]];
        longest[corner] = std::max(longest[corner], std::hypot(b[0] - a[0], b[1] - a[1]));
      }
    }
  for (std::size_t c = 0; c < corners_m_.size(); ++c)
    if (singular[c]) grade(net, static_cast<std::int32_t>(c), count_rings(angles[c], k * longest[c], setting_), setting_.ratio);
  return net;
}

Polygon::Solved Polygon::solve(double max_kappa) {
  const double k = std::sqrt(max_kappa), edge = std::min(setting_.edge_radians / k, 0.34 * longest_m_);
  if (const double wanted = area_m2_ * max_kappa / (4.0 * pi); wanted > kMaxWanted)
    throw InputError(
        fmt::format("the membrane has about {:.2g} modes up to the end of its band, more than the finite elements can resolve "
                    "({}); lower the end of \"band_hz\", or give \"max_modes\"",
                    wanted, kMaxWanted));
  elements_ = make_elements(k, edge);
  const TriangleModes coarse = solve_triangles(elements_, TriangleBasis(basis_.order() - 1), 1.02 * max_kappa);
  modes_ = solve_triangles(elements_, basis_, max_kappa);
  Solved solved{modes_.kappa, {}};
  for (std::size_t m = 0; m < modes_.kappa.size(); ++m)
    solved.error.push_back(m < coarse.kappa.size() ? std::max(kSlow * std::abs(coarse.kappa[m] / modes_.kappa[m] - 1.0), kMinError) : 1.0);
  refine(solved);
  return solved;
}

/// Refines eigenvalues only: shapes are already exact to the bank's steps.
void Polygon::refine(Solved& solved) {
  refined_ = 0;
  if (!setting_.uses_particular_solutions) return;
  const std::optional<ParticularSolutions> solutions = ParticularSolutions::make(corners_m_);
  if (!solutions) return;
  const std::size_t count = std::min<std::size_t>(solved.kappa.size(), kMaxRefined);
  for (std::size_t m = 0; m < count;) {
    std::size_t end = m + 1;
    while (end < solved.kappa.size() &&
           solved.kappa[end] - solved.kappa[end - 1] <= (kDegenerate + 2.0 * solved.error[end]) * solved.kappa[end])
      ++end;
    const double middle = 0.5 * (solved.kappa[m] + solved.kappa[end - 1]);
    double error = 0.5 * (solved.kappa[end - 1] - solved.kappa[m]) / middle;
    for (std::size_t i = m; i < end; ++i) error = std::max(error, solved.error[i]);
    // Equal eigenvalues of a group vanish together; other groups stay as they are.
    const auto found = solutions->refine(middle, error, static_cast<int>(end - m));
    if (found && std::abs(found->kappa / middle - 1.0) <= 2.0 * error)
      for (std::size_t i = m; i < end; ++i, ++refined_) {
        solved.kappa[i] = found->kappa;
        solved.error[i] = found->error;
      }
    m = end;
  }
}

ModeList Polygon::list_modes(double high_hz, std::int64_t max_modes) {
  if (lowest_hz_) {
    // kappa_1 of the disc of this area is a lower bound (Faber, Krahn); four times that suffices for a narrow polygon.
    double kappa = 1.5 * square(2.404825557695773) * pi / area_m2_;
    Solved lowest = solve(kappa);
    while (lowest.kappa.empty()) lowest = solve(kappa *= 2.0);
    rate_ = square(2.0 * pi * *lowest_hz_) / lowest.kappa[0];
  } else {
    rate_ = *tension_n_m_ / density_kg_m2_;
  }
  const double asked = square(2.0 * pi * high_hz) / rate_;
  const double k = find_wave_number(area_m2_, rim_m_, 1.05 * static_cast<double>(max_modes) + 5.0);
  const double kappa = std::min(asked, square(k));
  ModeList list{{}, kappa < asked ? std::sqrt(kappa * rate_) / (2.0 * pi) : high_hz};
  const Solved solved = solve(kappa);
  for (std::size_t m = 0; m < solved.kappa.size(); ++m)
    list.modes.push_back(
        {rate_ * solved.kappa[m], 600.0 * std::log2(1.0 + solved.error[m]), {static_cast<int>(m), 0, 0, 0}, fmt::format("{}", m + 1)});
  std::stable_sort(list.modes.begin(), list.modes.end(), [](const Mode& a, const Mode& b) { return a.lambda_rad2_s2 < b.lambda_rad2_s2; });
  method = fmt::format("triangles of order {}, {} of them, all eigenvalues counted by inertia{}", basis_.order(),
                       elements_.triangles.size(), refined_ > 0 ? fmt::format("; {} refined by particular solutions", refined_) : "");
  return list;
}

/// The element that contains a point or is nearest to it.
std::size_t Polygon::find_element(const Point2& x, double& r, double& s) const {
  std::size_t best = 0;
  double outside = 1e300;
  const std::size_t count = elements_.triangles.size();
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t t = (last_element_ + i) % count;
    const Triangle& v = elements_.triangles[t];
    const Point2 &a = elements_.points_m[v[0]], &b = elements_.points_m[v[1]], &c = elements_.points_m[v[2]];
    const double bx = b[0] - a[0], by = b[1] - a[1], cx = c[0] - a[0], cy = c[1] - a[1], twice = bx * cy - by * cx;
    const double one = ((x[0] - a[0]) * cy - (x[1] - a[1]) * cx) / twice, other = (bx * (x[1] - a[1]) - by * (x[0] - a[0])) / twice;
    const double off = std::max({-one, -other, one + other - 1.0, 0.0}) * std::sqrt(twice);
    if (off >= outside) continue;
    outside = off;
    best = t;
    r = one;
    s = other;
    if (off <= 0.0) break;
  }
  return last_element_ = best;
}

void Polygon::calc_deflections(const Point2& point_m, std::span<const Mode> modes, std::span<double> w) const {
  double r = 0.0, s = 0.0;
  const std::size_t t = find_element(point_m, r, s);
  r = std::clamp(r, 0.0, 1.0);
  s = std::clamp(s, 0.0, 1.0 - r);
  const la::Vector values = basis_.calc(r, s) / std::sqrt(density_kg_m2_);
  for (std::size_t i = 0; i < modes.size(); ++i) {
    double sum = 0.0;
    for (int n = 0; n < basis_.size(); ++n) sum += values(n) * modes_.shapes(modes_.elements[t][n], modes[i].index[0]);
    w[i] = sum;
  }
}

la::Matrix Polygon::calc_slope_products(std::span<const Mode> modes) const {
  la::Matrix products = la::Matrix::Zero(static_cast<Eigen::Index>(modes.size()), static_cast<Eigen::Index>(modes.size()));
  for (std::size_t i = 0; i < modes.size(); ++i)
    products(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)) = modes[i].lambda_rad2_s2 / (rate_ * density_kg_m2_);
  return products;
}

Net Polygon::make_net(int grid) const {
  if (side_m_ <= 0.0) return triangulate(corners_m_, 1.5 * longest_m_ / grid);
  // L shape: three squares of a regular mesh.
  const int half = std::max(1, grid / 2);
  const Net whole = make_rectangle_net(2.0 * side_m_, 2.0 * side_m_, 2 * half, 2 * half);
  Net net;
  std::vector<std::int32_t> number(whole.points_m.size(), -1);
  for (std::size_t t = 0; t < whole.triangles.size(); ++t) {
    const int cell = static_cast<int>(t / 2), column = cell % (2 * half), row = cell / (2 * half);
    if (column >= half && row >= half) continue;
    Triangle triangle = whole.triangles[t];
    for (std::int32_t& v : triangle) {
      if (number[v] < 0) {
        number[v] = static_cast<std::int32_t>(net.points_m.size());
        net.points_m.push_back(whole.points_m[v]);
      }
      v = number[v];
    }
    net.triangles.push_back(triangle);
  }
  return net;
}

int Polygon::choose_grid(std::span<const Mode> modes) const {
  const double k = std::sqrt(modes.empty() ? 0.0 : modes.back().lambda_rad2_s2 / rate_);
  return std::clamp(10 * static_cast<int>(std::ceil(0.4 * k * longest_m_ / pi)), 40, kMaxDefaultGrid);
}

}  // namespace carillon::analytic

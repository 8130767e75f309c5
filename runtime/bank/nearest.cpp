// Method: closest point of a triangle by Voronoi regions (corners, edges, face); a tree of axis-aligned boxes split at the median of the
//   triangle centres along the longest side, nearer child first.
// Source: Ericson, Real-Time Collision Detection (2005), sections 5.1.5 and 6.2.
// Deviations: a box is skipped only if farther than the best point by more than rounding, and ties go to the lowest triangle, so that tree
//   and linear search agree bit for bit.
#include "runtime/bank/nearest.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::bank {
namespace {

constexpr std::int32_t kLeafTriangles = 6;       // triangles per leaf
constexpr int kMaxTreeDepth = 64;                // 2^31 triangles need 31 levels
constexpr double kMinArea = 1e-14;               // (height / length)^2 of a triangle
constexpr double kRoundingFactor = 1.0 - 1e-12;  // bound of a squared distance's rounding

/// Parameter 0 to 1 of the point of segment (a, b) closest to p.
double find_along(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 ab = b - a;
  const double square = dot(ab, ab);
  return square > 0.0 ? std::clamp(dot(p - a, ab) / square, 0.0, 1.0) : 0.0;
}

/// find_nearest_barycentric() by the three edges only, for degenerate triangles.
Vec3 find_on_edges(const Vec3& p, const std::array<Vec3, 3>& corner) {
  Vec3 best{1.0, 0.0, 0.0};
  double min = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const double t = find_along(p, corner[i], corner[j]);
    Vec3 way{};
    for (std::size_t k = 0; k < 3; ++k) way[k] = corner[i][k] + t * (corner[j][k] - corner[i][k]) - p[k];
    if (!(dot(way, way) < min)) continue;
    min = dot(way, way);
    best = {};
    best[i] = 1.0 - t;
    best[j] += t;
  }
  return best;
}

bool is_a_place(const Vec3& point_m) {
  return std::all_of(point_m.begin(), point_m.end(), [](double x) { return std::abs(x) <= kFarthestPointM; });  // false for NaN
}

/// Updates `best` if the triangle is closer, or equally close with a lower index.
void try_triangle(const Bank& bank, std::int32_t triangle, const Vec3& p, double& min, NearestPlace& best) {
  const auto& corner = bank.triangles[triangle];
  const Vec3 &a = bank.vertices_m[corner[0]], &b = bank.vertices_m[corner[1]], &c = bank.vertices_m[corner[2]];
  const Vec3 weight = find_nearest_barycentric(p, a, b, c);
  Vec3 place{};
  for (std::size_t k = 0; k < 3; ++k) place[k] = weight[0] * a[k] + weight[1] * b[k] + weight[2] * c[k];
  const Vec3 way = place - p;
  const double square = dot(way, way);
  if (!(square < min || (square == min && triangle < best.triangle))) return;
  min = square;
  best = {triangle, weight, place, 0.0};
}

double calc_square(const Vec3& p, const Vec3& low, const Vec3& high) {
  double square = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double out = std::max({low[k] - p[k], 0.0, p[k] - high[k]});
    square += out * out;
  }
  return square;
}

}  // namespace

Vec3 find_nearest_barycentric(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) noexcept {
  const Vec3 ab = b - a, ac = c - a;
  // For a degenerate triangle the regions are dominated by rounding.
  const double square_ab = dot(ab, ab), square_ac = dot(ac, ac), along = dot(ab, ac);
  if (!(square_ab * square_ac - along * along > kMinArea * std::max(square_ab, square_ac) * std::max(square_ab, square_ac)))
    return find_on_edges(p, {a, b, c});
  const Vec3 ap = p - a, bp = p - b, cp = p - c;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp), d6 = dot(ac, cp);
  const Vec3 weight = weigh_corners(d1, d2, d3, d4, d5, d6);
  const bool is_inside = std::all_of(weight.begin(), weight.end(), [](double w) { return w >= 0.0 && w <= 1.0; });
  return is_inside ? weight : find_on_edges(p, {a, b, c});
}

NearestPlace find_nearest(const Bank& bank, const Vec3& point_m) noexcept {
  NearestPlace best;
  if (!is_a_place(point_m)) return best;
  double min = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < bank.triangles.size(); ++t) try_triangle(bank, static_cast<std::int32_t>(t), point_m, min, best);
  best.distance_m = best.triangle < 0 ? 0.0 : std::sqrt(min);
  return best;
}

SurfaceTree::SurfaceTree(const Bank& bank) : bank_(&bank), order_(bank.triangles.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  std::vector<Vec3> centres_m;
  centres_m.reserve(order_.size());
  for (const auto& corner : bank.triangles) {
    Vec3 sum{};
    for (const std::int32_t v : corner) {
      for (std::size_t k = 0; k < 3; ++k) sum[k] += bank.vertices_m[v][k];
    }
    centres_m.push_back(sum);
  }
  boxes_.reserve(order_.size());
  if (!order_.empty()) build(centres_m, 0, static_cast<std::int32_t>(order_.size()));
}

std::int32_t SurfaceTree::build(std::vector<Vec3>& centres_m, std::int32_t first, std::int32_t last) {
  const auto at = static_cast<std::int32_t>(boxes_.size());
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  Box box{{kInfinite, kInfinite, kInfinite}, {-kInfinite, -kInfinite, -kInfinite}, first, last - first};
  for (std::int32_t i = first; i < last; ++i) {
    for (const std::int32_t v : bank_->triangles[order_[i]]) {
      for (std::size_t k = 0; k < 3; ++k) {
        const double x = bank_->vertices_m[v][k];
        box.low[k] = std::min(box.low[k], x);
        box.high[k] = std::max(box.high[k], x);
      }
    }
  }
  boxes_.push_back(box);
  if (last - first <= kLeafTriangles) return at;
  const Vec3 extent = box.high - box.low;
  const std::size_t axis = std::max_element(extent.begin(), extent.end()) - extent.begin();
  const std::int32_t middle = first + (last - first) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](std::int32_t s, std::int32_t t) { return centres_m[s][axis] < centres_m[t][axis]; });
  build(centres_m, first, middle);
  const std::int32_t second = build(centres_m, middle, last);
  boxes_[at].first = second;
  boxes_[at].count = 0;
  return at;
}

NearestPlace SurfaceTree::find(const Vec3& point_m) const noexcept {
  NearestPlace best;
  if (boxes_.empty() || !is_a_place(point_m)) return best;
  struct Waiting {
    std::int32_t box;
    double square;
  };
  const auto weigh = [&](std::int32_t at) {
    const Box& box = boxes_[at];
    return Waiting{at, calc_square(point_m, box.low, box.high)};
  };
  double min = std::numeric_limits<double>::infinity();
  std::array<Waiting, kMaxTreeDepth> stack;
  int depth = 0;
  stack[depth++] = weigh(0);
  while (depth > 0) {
    const Waiting next = stack[--depth];
    if (next.square * kRoundingFactor > min) continue;
    const Box& box = boxes_[next.box];
    if (box.count > 0) {
      for (std::int32_t i = box.first; i < box.first + box.count; ++i) try_triangle(*bank_, order_[i], point_m, min, best);
      continue;
    }
    Waiting near = weigh(next.box + 1), far = weigh(box.first);
    if (far.square < near.square) std::swap(near, far);
    stack[depth++] = far;
    stack[depth++] = near;
  }
  best.distance_m = best.triangle < 0 ? 0.0 : std::sqrt(min);
  return best;
}

}  // namespace carillon::bank

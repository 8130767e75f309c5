#include "precompute/mesher/two_sides.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <unordered_map>

#include "precompute/mesh/parts.hpp"
#include "precompute/mesher/nearest.hpp"
#include "runtime/base/sort_order.hpp"

namespace carillon::mesher {

std::optional<TwoSides> find_two_sides(const TriangleSurface& closed) {
  constexpr double kMinOppositeCosine = 0.9;  // cosine
  constexpr double kMaxOfDiagonal = 0.2, kMaxOfMedian = 3;
  constexpr double kMinSideAreaRatio = 0.3, kMaxRimAreaRatio = 0.25;  // of the area
  constexpr std::size_t kMaxTriangles = 200'000;
  const std::size_t count = closed.triangles.size();
  if (count > kMaxTriangles) return std::nullopt;
  const NearestPoint tree(closed);
  std::vector<Vec3> normal(count);
  std::vector<double> area(count), way(count, HUGE_VAL);
  std::vector<std::int32_t> other(count, -1);
  for (std::size_t f = 0; f < count; ++f) {
    const Triangle& t = closed.triangles[f];
    const Vec3 a = cross(closed.points[t[1]] - closed.points[t[0]], closed.points[t[2]] - closed.points[t[0]]);
    area[f] = 0.5 * norm(a);
    if (area[f] > 0) normal[f] = normalise(a);
  }
  for (std::size_t f = 0; f < count; ++f) {
    if (!(area[f] > 0)) continue;
    const Triangle& t = closed.triangles[f];
    const Vec3 middle = (1.0 / 3) * (closed.points[t[0]] + closed.points[t[1]] + closed.points[t[2]]);
    const auto hit = tree.find_hit(middle, -1.0 * normal[f], static_cast<std::int32_t>(f));
    if (!hit || -dot(normal[f], normal[hit->second]) < kMinOppositeCosine) continue;
    way[f] = hit->first;
    other[f] = hit->second;
  }
  const double all = std::accumulate(area.begin(), area.end(), 0.0);
  double sum = 0, median = HUGE_VAL;
  for (const std::size_t f : base::find_sort_order(way))
    if ((sum += area[f]) >= 0.5 * all) {
      median = way[f];
      break;
    }
  if (!(median < kMaxOfDiagonal * calc_box(closed.points).diagonal())) return std::nullopt;
  std::vector<char> thin(count, 0);
  for (std::size_t f = 0; f < count; ++f) thin[f] = way[f] < kMaxOfMedian * median;
  // Sides: triangles with a thin wall, connected by edges.
  mesh::Parts parts(count);
  std::unordered_map<Edge, std::int32_t, EdgeHash> first;
  for (std::size_t f = 0; f < count; ++f) {
    if (thin[f] == 0) continue;
    const Triangle& t = closed.triangles[f];
    for (int c = 0; c < 3; ++c) {
      const auto [found, fresh] = first.try_emplace(make_edge(t[c], t[(c + 1) % 3]), static_cast<std::int32_t>(f));
      if (!fresh) parts.join(static_cast<std::int32_t>(f), found->second);
    }
  }
  std::map<std::int32_t, double> sides;
  for (std::size_t f = 0; f < count; ++f)
    if (thin[f] != 0) sides[parts.find(static_cast<std::int32_t>(f))] += area[f];
  std::vector<std::pair<double, std::int32_t>> largest;
  for (const auto& [side, a] : sides) largest.emplace_back(-a, side);
  std::sort(largest.begin(), largest.end());
  if (largest.size() < 2 || -largest[1].first < kMinSideAreaRatio * all) return std::nullopt;
  if (all + largest[0].first + largest[1].first > kMaxRimAreaRatio * all) return std::nullopt;
  double facing = 0;
  TwoSides result;
  result.thickness_m = median;
  for (std::size_t f = 0; f < count; ++f) {
    if (thin[f] == 0) continue;
    const std::int32_t side = parts.find(static_cast<std::int32_t>(f));
    for (int n = 0; n < 2; ++n) {
      if (side != largest[n].second) continue;
      (n == 0 ? result.outer : result.inner).triangles.push_back(closed.triangles[f]);
      if (thin[other[f]] != 0 && parts.find(other[f]) == largest[1 - n].second) facing += area[f];
    }
  }
  constexpr double kMinFacing = 0.9;
  if (facing < kMinFacing * -(largest[0].first + largest[1].first)) return std::nullopt;
  for (TriangleSurface* side : {&result.outer, &result.inner}) {
    std::unordered_map<std::int32_t, std::int32_t> number;
    for (Triangle& t : side->triangles)
      for (std::int32_t& v : t) {
        const auto [found, fresh] = number.try_emplace(v, static_cast<std::int32_t>(side->points.size()));
        if (fresh) side->points.push_back(closed.points[v]);
        v = found->second;
      }
  }
  return result;
}

}  // namespace carillon::mesher

// Method:     facets are ordered by recursive bisection of their centroids; nodes and edges are numbered in that order. Smallest sphere:
//   iterative form of Welzl's algorithm with move-to-front.
// Source:     E. Welzl, Smallest enclosing disks (1991).
#include "precompute/air/surface.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "runtime/base/error.hpp"

namespace carillon::air {
namespace {

constexpr double kFlat = 1e-10;  // area over squared longest edge of a degenerate triangle

void order_range(std::span<const Vec3> places, std::span<std::int32_t> items, std::size_t run) {
  if (items.size() <= run) return;
  Vec3 low = places[items[0]], high = low;
  for (const std::int32_t i : items)
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], places[i][k]);
      high[k] = std::max(high[k], places[i][k]);
    }
  const Vec3 side = high - low;
  const std::size_t axis = std::max_element(side.begin(), side.end()) - side.begin();
  const std::size_t half = (items.size() / run + 1) / 2 * run;  // whole runs in front
  const std::size_t cut = std::min(half, items.size());
  const auto before = [&](std::int32_t a, std::int32_t b) {
    return places[a][axis] != places[b][axis] ? places[a][axis] < places[b][axis] : a < b;
  };
  std::nth_element(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(cut), items.end(), before);
  if (cut == 0 || cut == items.size()) return std::sort(items.begin(), items.end());
  order_range(places, items.first(cut), run);
  order_range(places, items.subspan(cut), run);
}

/// Sphere through the support points, in their affine span.
Sphere make_sphere(std::span<const Vec3> support) {
  if (support.empty()) return {};
  const Vec3 base = support[0];
  // centre = base + sum of x_i e_i with 2 e_i . e_j x_j = e_i . e_i
  const std::size_t n = support.size() - 1;
  double a[3][4] = {};
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 e = support[i + 1] - base;
    for (std::size_t j = 0; j < n; ++j) a[i][j] = 2.0 * dot(e, support[j + 1] - base);
    a[i][n] = dot(e, e);
  }
  for (std::size_t i = 0; i < n; ++i) {
    std::size_t pivot = i;
    for (std::size_t r = i + 1; r < n; ++r)
      if (std::abs(a[r][i]) > std::abs(a[pivot][i])) pivot = r;
    if (a[pivot][i] == 0.0) return {base, -1.0};
    std::swap(a[i], a[pivot]);
    for (std::size_t r = 0; r < n; ++r) {
      if (r == i) continue;
      const double f = a[r][i] / a[i][i];
      for (std::size_t c = i; c <= n; ++c) a[r][c] -= f * a[i][c];
    }
  }
  Vec3 offset{};
  for (std::size_t i = 0; i < n; ++i) offset = offset + (a[i][n] / a[i][i]) * (support[i + 1] - base);
  return {base + offset, norm(offset)};
}

bool is_outside(const Sphere& sphere, const Vec3& point) { return norm(point - sphere.centre_m) > sphere.radius_m * (1.0 + 1e-11); }

/// Smallest sphere of the first `count` points with the support on its surface. Moves significant points to the front.
Sphere enclose(std::vector<Vec3>& points, std::size_t count, std::vector<Vec3>& support) {
  Sphere sphere = support.empty() ? Sphere{points[0], 0.0} : make_sphere(support);
  if (support.size() == 4 || sphere.radius_m < 0.0) return sphere;
  for (std::size_t i = 0; i < count; ++i) {
    if (!is_outside(sphere, points[i])) continue;
    support.push_back(points[i]);
    const Sphere larger = enclose(points, i, support);
    support.pop_back();
    if (larger.radius_m >= sphere.radius_m) sphere = larger;
    std::rotate(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(i), points.begin() + static_cast<std::ptrdiff_t>(i) + 1);
  }
  return sphere;
}

}  // namespace

std::vector<std::int32_t> order_by_place(std::span<const Vec3> places_m, std::size_t run) {
  std::vector<std::int32_t> order(places_m.size());
  std::iota(order.begin(), order.end(), 0);
  order_range(places_m, order, run);
  return order;
}

Sphere find_enclosing_sphere(std::span<const Vec3> points_m) {
  if (points_m.empty()) throw InputError("a sphere around no points");
  std::vector<Vec3> points(points_m.begin(), points_m.end()), support;
  Sphere sphere = enclose(points, points.size(), support);
  for (const Vec3& point : points_m) sphere.radius_m = std::max(sphere.radius_m, norm(point - sphere.centre_m));
  return sphere;
}

RadiatingSurface::RadiatingSurface(std::span<const Vec3> nodes_m, std::span<const Triangle> triangles) {
  std::vector<std::int32_t> kept;
  std::vector<Vec3> centroids;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto& [a, b, c] = triangles[t];
    const Vec3 &p = nodes_m[a], &q = nodes_m[b], &r = nodes_m[c];
    if (!std::isfinite(dot(p, p) + dot(q, q) + dot(r, r))) throw InputError("a vertex of the surface is not finite");
    const double size = std::max({norm(q - p), norm(r - q), norm(p - r)});
    if (!(norm(cross(q - p, r - p)) > kFlat * size * size)) continue;
    kept.push_back(static_cast<std::int32_t>(t));
    centroids.push_back((1.0 / 3.0) * (p + q + r));
  }
  if (kept.empty()) throw InputError("no triangle of the surface has an area");
  std::vector<std::int32_t> number(nodes_m.size(), -1);
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> edges;
  for (const std::int32_t k : order_by_place(centroids, 16)) {
    const std::int32_t source = kept[k];
    Facet facet;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::int32_t node = triangles[source][c];
      if (number[node] < 0) {
        number[node] = static_cast<std::int32_t>(nodes_m_.size());
        nodes_m_.push_back(nodes_m[node]);
      }
      facet.corners[c] = number[node];
    }
    const Vec3 &p = nodes_m_[facet.corners[0]], &q = nodes_m_[facet.corners[1]], &r = nodes_m_[facet.corners[2]];
    const Vec3 normal = cross(q - p, r - p);
    facet.area_m2 = norm(normal) / 2.0;
    facet.normal = normalise(normal);
    facet.size_m = std::max({norm(q - p), norm(r - q), norm(p - r)});
    const double per_area = 1.0 / (2.0 * facet.area_m2);
    facet.curl = {per_area * (r - q), per_area * (p - r), per_area * (q - p)};
    for (std::size_t c = 0; c < 3; ++c) {
      const std::int32_t a = facet.corners[(c + 1) % 3], b = facet.corners[(c + 2) % 3];
      const auto [found, is_new] = edges.try_emplace(std::minmax(a, b), static_cast<std::int32_t>(points_.size()));
      if (is_new) points_.push_back({0.5 * (nodes_m_[a] + nodes_m_[b]), {std::min(a, b), std::max(a, b)}, facet.size_m});
      facet.points[c] = found->second;
      EdgePoint& point = points_[found->second];
      point.size_m = std::min(point.size_m, facet.size_m);
    }
    facets_.push_back(facet);
    facet_source_.push_back(source);
  }
}

double RadiatingSurface::calc_area_m2() const {
  double area = 0.0;
  for (const Facet& facet : facets_) area += facet.area_m2;
  return area;
}

double RadiatingSurface::calc_volume_m3() const {
  double volume = 0.0;
  const Vec3 base = nodes_m_[0];
  for (const Facet& facet : facets_) volume += dot(nodes_m_[facet.corners[0]] - base, facet.normal) * facet.area_m2 / 3.0;
  return volume;
}

}  // namespace carillon::air

// Method: triangles sharing edges form shells (union-find); the sign of a shell's enclosed volume (divergence theorem) distinguishes outer
//   surface and cavity.
#include "runtime/bank/surface.hpp"

#include <algorithm>
#include <cstddef>

#include "runtime/bank/edges.hpp"
#include "runtime/base/groups.hpp"

namespace carillon::bank {
namespace {

/// Per triangle: the smallest triangle connected through edges.
std::vector<std::int32_t> find_shells(const std::vector<Triangle>& triangles, std::size_t vertices) {
  const auto count = static_cast<int>(triangles.size());
  base::Groups shells(count);
  for_each_edge(triangles, vertices, [&](std::int32_t, const HalfEdge* first, const HalfEdge* last) {
    for (const HalfEdge* edge = first + 1; edge < last; ++edge) shells.join(edge->number / 3, edge[-1].number / 3);
  });
  std::vector<std::int32_t> shell(triangles.size());
  for (int t = 0; t < count; ++t) shell[t] = shells.find(t);
  return shell;
}

}  // namespace

Vec3 calc_normal(const std::vector<Vec3>& vertices_m, const Triangle& triangle) {
  const Vec3 &a = vertices_m[triangle[0]], &b = vertices_m[triangle[1]], &c = vertices_m[triangle[2]];
  return cross(b - a, c - a);
}

std::array<Vec3, 2> find_extent(const std::vector<Vec3>& vertices_m) {
  std::array<Vec3, 2> extent{vertices_m.front(), vertices_m.front()};
  for (const Vec3& x : vertices_m)
    for (std::size_t c = 0; c < 3; ++c) {
      extent[0][c] = std::min(extent[0][c], x[c]);
      extent[1][c] = std::max(extent[1][c], x[c]);
    }
  return extent;
}

double calc_thickness_m(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles, double volume_m3) {
  double twice_area_m2 = 0.0;
  for (const Triangle& triangle : triangles) twice_area_m2 += norm(calc_normal(vertices_m, triangle));
  return volume_m3 > 0.0 && twice_area_m2 > 0.0 ? 4.0 * volume_m3 / twice_area_m2 : 0.0;
}

std::vector<Triangle> find_outer_triangles(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles) {
  const std::vector<std::int32_t> shell = find_shells(triangles, vertices_m.size());
  std::vector<double> volume(triangles.size(), 0.0);  // per shell, at its first triangle: 6 V about its first corner
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const Vec3& base = vertices_m[triangles[shell[t]][0]];
    const Vec3 normal = calc_normal(vertices_m, triangles[t]);
    for (int k = 0; k < 3; ++k) volume[shell[t]] += (vertices_m[triangles[t][0]][k] - base[k]) * normal[k];
  }
  std::vector<Triangle> outer;
  for (std::size_t t = 0; t < triangles.size(); ++t)
    if (volume[shell[t]] > 0.0) outer.push_back(triangles[t]);
  return outer;
}

}  // namespace carillon::bank

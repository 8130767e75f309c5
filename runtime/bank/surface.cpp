// Method:     triangles that share an edge are joined into shells (union-find over sorted edges); the sign of the volume that a shell
//             encloses, by the divergence theorem, tells skin from cavity.
// Source:     textbook.
// Deviations: none.
#include "runtime/bank/surface.hpp"

#include <algorithm>
#include <compare>
#include <cstddef>
#include <numeric>

namespace carillon::bank {
namespace {

/// Per triangle the smallest triangle that it is connected with through edges.
std::vector<std::size_t> find_shells(const std::vector<Triangle>& triangles) {
  struct Edge {
    std::int32_t low, high;
    std::size_t triangle;
    auto operator<=>(const Edge&) const = default;
  };
  // Edges lie in buckets by their lower vertex, and are sorted within them.
  std::int32_t last = -1;
  for (const Triangle& triangle : triangles)
    for (const std::int32_t v : triangle) last = std::max(last, v);
  const auto find_ends = [](const Triangle& triangle, std::size_t i) { return std::minmax({triangle[i], triangle[(i + 1) % 3]}); };
  std::vector<std::size_t> begin(static_cast<std::size_t>(last) + 2, 0);
  for (const Triangle& triangle : triangles)
    for (std::size_t i = 0; i < 3; ++i) ++begin[static_cast<std::size_t>(find_ends(triangle, i).first) + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  std::vector<Edge> edges(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = find_ends(triangles[t], i);
      edges[next[static_cast<std::size_t>(low)]++] = {low, high, t};
    }
  for (std::size_t v = 0; v + 1 < begin.size(); ++v)
    std::sort(edges.begin() + static_cast<std::ptrdiff_t>(begin[v]), edges.begin() + static_cast<std::ptrdiff_t>(begin[v + 1]));
  std::vector<std::size_t> shell(triangles.size());
  std::iota(shell.begin(), shell.end(), std::size_t{0});
  const auto find = [&](std::size_t t) {
    while (shell[t] != t) t = shell[t] = shell[shell[t]];
    return t;
  };
  for (std::size_t i = 1; i < edges.size(); ++i) {
    if (edges[i].low != edges[i - 1].low || edges[i].high != edges[i - 1].high) continue;
    const std::size_t a = find(edges[i].triangle), b = find(edges[i - 1].triangle);
    shell[std::max(a, b)] = std::min(a, b);
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) shell[t] = find(t);
  return shell;
}

}  // namespace

Vec3 calc_normal(const std::vector<Vec3>& vertices_m, const Triangle& triangle) {
  const Vec3 &a = vertices_m[triangle[0]], &b = vertices_m[triangle[1]], &c = vertices_m[triangle[2]];
  Vec3 u, v;
  for (int k = 0; k < 3; ++k) {
    u[k] = b[k] - a[k];
    v[k] = c[k] - a[k];
  }
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

std::vector<Triangle> find_outer_triangles(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles) {
  const std::vector<std::size_t> shell = find_shells(triangles);
  std::vector<double> volume(triangles.size(), 0.0);  // of a shell, at its first triangle: six times, about its own first corner
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

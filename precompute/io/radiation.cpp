// Method: one omnidirectional gain per mode from the volume velocity of the surface, taken triangle by triangle without sign, as of a
//   pulsating sphere of the same area.
// Source: OSG02 section 3.4 (one gain per mode); Pierce 1981, Acoustics, section 4.1 (pulsating sphere).
// Deviations: OSG02 sums the signed normal displacement, which is zero for every bending mode of a symmetric body; here its absolute value
//   times area. The sign is dropped after the integral over a triangle, not inside it: a motion along a curved surface leaks through flat
//   triangles with both signs, which cancel within each. The factor 1 / sqrt(1 + (k a)^2) bounds the gain at high frequencies, where
//   OSG02's grows without end.
#include "precompute/io/radiation.hpp"

#include <algorithm>
#include <cmath>
#include <compare>
#include <map>
#include <numbers>

#include "precompute/mesh/faces.hpp"

namespace carillon::io {
namespace {

/// Per triangle the smallest triangle that it is connected with through edges.
std::vector<std::size_t> find_shells(const std::vector<Triangle>& triangles) {
  struct Edge {
    std::int32_t low, high, triangle;
    auto operator<=>(const Edge&) const = default;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(triangles[t][i], triangles[t][(i + 1) % 3]);
      edges.push_back({low, high, static_cast<std::int32_t>(t)});
    }
  std::sort(edges.begin(), edges.end());
  mesh::Parts parts(triangles.size());
  for (std::size_t i = 1; i < edges.size(); ++i)
    if (edges[i].low == edges[i - 1].low && edges[i].high == edges[i - 1].high) parts.join(edges[i].triangle, edges[i - 1].triangle);
  std::vector<std::size_t> shell(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) shell[t] = static_cast<std::size_t>(parts.find(static_cast<std::int32_t>(t)));
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
  std::map<std::size_t, double> volume;  // six times the volume that a shell encloses, about its own first corner
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

double calc_radiation_gain(double omega_rad_s, double flow, double area_m2) {
  const double ka = omega_rad_s / bank::kSoundSpeedMs * std::sqrt(area_m2 / (4 * std::numbers::pi));
  return bank::kAirDensityKgM3 * omega_rad_s / (4 * std::numbers::pi * std::sqrt(1 + ka * ka)) * flow;
}

}  // namespace carillon::io

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
#include <numeric>

namespace carillon::io {
namespace {

/// Twice the area times the unit normal.
Vec3 calc_normal(const std::vector<Vec3>& x, const Triangle& t) {
  Vec3 u, v;
  for (int k = 0; k < 3; ++k) {
    u[k] = x[t[1]][k] - x[t[0]][k];
    v[k] = x[t[2]][k] - x[t[0]][k];
  }
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

double norm(const Vec3& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/// Per triangle the smallest triangle that it is connected with through edges.
std::vector<std::size_t> find_shells(const std::vector<Triangle>& triangles) {
  std::vector<std::size_t> parent(triangles.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t t) {
    while (parent[t] != t) t = parent[t] = parent[parent[t]];
    return t;
  };
  struct Edge {
    std::int32_t low, high;
    std::size_t triangle;
    auto operator<=>(const Edge&) const = default;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(triangles[t][i], triangles[t][(i + 1) % 3]);
      edges.push_back({low, high, t});
    }
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = 1; i < edges.size(); ++i) {
    if (edges[i].low != edges[i - 1].low || edges[i].high != edges[i - 1].high) continue;
    const std::size_t a = root(edges[i].triangle), b = root(edges[i - 1].triangle);
    parent[std::max(a, b)] = std::min(a, b);
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) parent[t] = root(t);
  return parent;
}

}  // namespace

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

std::vector<double> calc_radiation_gain(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles,
                                        std::span<const double> omega_rad_s, std::span<const double> shapes) {
  const std::size_t modes = omega_rad_s.size();
  std::vector<double> flow(modes, 0.0);  // sum of |phi . n| A
  double area_sum = 0.0;
  for (const Triangle& t : find_outer_triangles(vertices_m, triangles)) {
    const Vec3 normal = calc_normal(vertices_m, t);
    area_sum += norm(normal) / 2;
    for (std::size_t m = 0; m < modes; ++m) {
      double through = 0.0;  // 3 phi . n of the middle, times twice the area
      for (int i = 0; i < 3; ++i) {
        const double* phi = &shapes[(t[i] * modes + m) * 3];
        through += phi[0] * normal[0] + phi[1] * normal[1] + phi[2] * normal[2];
      }
      flow[m] += std::abs(through) / 6;
    }
  }
  const double radius = std::sqrt(area_sum / (4 * std::numbers::pi));
  std::vector<double> gain(modes);
  for (std::size_t m = 0; m < modes; ++m) {
    const double ka = omega_rad_s[m] / bank::kSoundSpeedMs * radius;
    gain[m] = bank::kAirDensityKgM3 * omega_rad_s[m] / (4 * std::numbers::pi * std::sqrt(1 + ka * ka)) * flow[m];
  }
  return gain;
}

}  // namespace carillon::io

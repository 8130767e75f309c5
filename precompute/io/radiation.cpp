// Method: one omnidirectional gain per mode from the volume velocity of the surface, taken without sign, as of a pulsating sphere of the same
//   area. The integral of the absolute value of a linear function over a triangle is closed form: where the sign changes, the lone corner
//   cuts off a smaller similar piece.
// Source: OSG02 section 3.4 (one gain per mode); Pierce 1981, Acoustics, section 4.1 (pulsating sphere).
// Deviations: OSG02 sums the signed normal displacement, which is zero for every bending mode of a symmetric body; here its absolute value
//   times area. The factor 1 / sqrt(1 + (k a)^2) bounds the gain at high frequencies, where OSG02's grows without end.
#include "precompute/io/radiation.hpp"

#include <algorithm>
#include <cmath>
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

double calc_absolute_integral(double area, double a, double b, double c) {
  const double sum = a + b + c;
  std::array<double, 3> value{a, b, c};
  std::sort(value.begin(), value.end());
  if (value[0] >= 0 || value[2] <= 0) return area * std::abs(sum) / 3;
  // One corner has a sign of its own. The piece that it cuts off has the integral area p^3 / (3 (p - q) (p - r)), the rest the other sign.
  const double p = value[1] > 0 ? value[0] : value[2], q = value[1], r = value[1] > 0 ? value[2] : value[0];
  const double piece = area * (p / (p - q)) * (p / (p - r)) * p / 3;
  return std::abs(2 * piece - area * sum / 3);
}

std::vector<double> calc_radiation_gain(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles,
                                        std::span<const double> omega_rad_s, std::span<const double> shapes) {
  const std::size_t modes = omega_rad_s.size();
  std::vector<double> flow(modes, 0.0);  // integral |phi . n| dA
  double area_sum = 0.0;
  for (const Triangle& t : find_outer_triangles(vertices_m, triangles)) {
    const Vec3 normal = calc_normal(vertices_m, t);
    const double length = norm(normal), area = length / 2;
    if (!(length > 0.0)) continue;
    area_sum += area;
    for (std::size_t m = 0; m < modes; ++m) {
      std::array<double, 3> along{};
      for (int i = 0; i < 3; ++i) {
        const double* phi = &shapes[(t[i] * modes + m) * 3];
        along[i] = (phi[0] * normal[0] + phi[1] * normal[1] + phi[2] * normal[2]) / length;
      }
      flow[m] += calc_absolute_integral(area, along[0], along[1], along[2]);
    }
  }
  const double radius = std::sqrt(area_sum / (4 * std::numbers::pi));
  std::vector<double> gain(modes);
  for (std::size_t m = 0; m < modes; ++m) {
    const double ka = omega_rad_s[m] / kSoundSpeedMS * radius;
    gain[m] = kAirDensityKgM3 * omega_rad_s[m] / (4 * std::numbers::pi * std::sqrt(1 + ka * ka)) * flow[m];
  }
  return gain;
}

}  // namespace carillon::io

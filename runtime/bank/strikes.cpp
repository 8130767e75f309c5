// Method:     A blow J along the normal n at a vertex makes mode m sound with g_m |phi_m . n| J at 1 m; by the ear's weight of its
// frequency
//             (A-weighting) that is its level. Vertices are ranked by the sum of the squares.
// Source:     docs/equations.md, E5 and E7.
// Deviations: none.
#include "runtime/bank/strikes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/bank/reduce.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::bank {
namespace {

constexpr double kHeard = 0.1;  // of the loudest vertex's power: struck where less is made, it would seem broken

std::vector<Vec3> find_normals(const Bank& bank) {
  std::vector<Vec3> normals(bank.vertex_count(), Vec3{});
  for (const auto& t : bank.triangles) {
    const Vec3 &a = bank.vertices_m[static_cast<std::size_t>(t[0])], &b = bank.vertices_m[static_cast<std::size_t>(t[1])],
               &c = bank.vertices_m[static_cast<std::size_t>(t[2])];
    const Vec3 normal = cross(b - a, c - a);
    for (const std::int32_t v : t) normals[static_cast<std::size_t>(v)] = normals[static_cast<std::size_t>(v)] + normal;
  }
  for (Vec3& n : normals)
    if (norm(n) > 0.0) n = (1.0 / norm(n)) * n;
  return normals;
}

/// Of each mode, by what a unit blow makes of a unit of its shape along the normal.
std::vector<double> calc_weights(const Bank& bank) {
  std::vector<double> weights(bank.mode_count());
  for (std::size_t m = 0; m < weights.size(); ++m)
    weights[m] = calc_a_weight(bank.freq_hz(m)) * bank.radiation_gain[m] * bank.shape_scale[m];
  return weights;
}

/// The amplitude of a mode after a unit blow along the normal at a vertex.
double calc_level(const Bank& bank, const std::vector<double>& weights, std::size_t vertex, const Vec3& normal, std::size_t mode) {
  const std::int16_t* shape = &bank.shape[(vertex * bank.mode_count() + mode) * 3];
  return weights[mode] * std::abs(shape[0] * normal[0] + shape[1] * normal[1] + shape[2] * normal[2]);
}

}  // namespace

std::vector<std::size_t> find_strikes(const Bank& bank, std::size_t count) {
  const std::vector<Vec3> normals = find_normals(bank);
  const std::vector<double> weights = calc_weights(bank);
  std::vector<double> power(bank.vertex_count(), 0.0);
  for (std::size_t v = 0; v < power.size(); ++v)
    for (std::size_t m = 0; m < weights.size(); ++m) power[v] += std::pow(calc_level(bank, weights, v, normals[v], m), 2);
  std::vector<std::size_t> chosen;
  if (power.empty()) return chosen;
  chosen.push_back(static_cast<std::size_t>(std::max_element(power.begin(), power.end()) - power.begin()));
  std::vector<double> distance(power.size(), std::numeric_limits<double>::infinity());
  while (chosen.size() < count) {
    std::size_t next = 0;
    double farthest = 0.0;
    for (std::size_t v = 0; v < power.size(); ++v) {
      distance[v] = std::min(distance[v], norm(bank.vertices_m[v] - bank.vertices_m[chosen.back()]));
      if (power[v] > kHeard * power[chosen[0]] && distance[v] > farthest) farthest = distance[v], next = v;
    }
    if (!(farthest > 0.0)) break;
    chosen.push_back(next);
  }
  return chosen;
}

std::vector<double> calc_blow_levels(const Bank& bank, std::size_t vertex) {
  const Vec3 normal = find_normals(bank)[vertex];
  const std::vector<double> weights = calc_weights(bank);
  std::vector<double> levels(bank.mode_count());
  for (std::size_t m = 0; m < levels.size(); ++m) levels[m] = calc_level(bank, weights, vertex, normal, m);
  return levels;
}

}  // namespace carillon::bank

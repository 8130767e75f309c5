// Method: a blow J along the normal n at a vertex excites mode m with g_m |phi_m . n| J at 1 m; A-weighted this is its level. Vertices are
//   ranked by the sum of squares.
// Source: docs/equations.md, E5 and E7.
#include "runtime/bank/blows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/bank/reduce.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::bank {
namespace {

constexpr double kMinStrikePower = 0.1;  // minimum power of a strike position, relative to the loudest vertex
constexpr double kLoudest = 0.1;

/// A-weighted level of each mode per unit motion, (m).
std::vector<double> calc_weights(const Bank& bank) {
  std::vector<double> weights(bank.mode_count());
  for (std::size_t m = 0; m < weights.size(); ++m) weights[m] = calc_a_weight(bank.freq_hz(m)) * bank.radiation_gain[m];
  return weights;
}

}  // namespace

std::vector<Vec3> calc_vertex_normals(const Bank& bank) {
  std::vector<Vec3> normals(bank.vertex_count(), Vec3{});
  for (const Triangle& t : bank.triangles) {
    const Vec3 normal = calc_normal(bank.vertices_m, t);
    for (const std::int32_t v : t) normals[v] = normals[v] + normal;
  }
  for (Vec3& n : normals)
    if (norm(n) > 0.0) n = (1.0 / norm(n)) * n;
  return normals;
}

std::vector<double> calc_blow_amplitudes(const Bank& bank, std::size_t vertex, const Vec3& direction) {
  std::vector<double> amplitudes = calc_weights(bank);
  for (std::size_t m = 0; m < amplitudes.size(); ++m) amplitudes[m] *= std::abs(dot(bank.shape_at(vertex, m), direction));
  return amplitudes;
}

std::vector<std::size_t> find_strikes(const Bank& bank, std::size_t count) {
  const std::vector<Vec3> normals = calc_vertex_normals(bank);
  const std::vector<double> weights = calc_weights(bank);
  std::vector<double> power(bank.vertex_count(), 0.0);
  for (std::size_t v = 0; v < power.size(); ++v)
    for (std::size_t m = 0; m < weights.size(); ++m) power[v] += std::pow(weights[m] * dot(bank.shape_at(v, m), normals[v]), 2);
  std::vector<std::size_t> chosen;
  if (power.empty()) return chosen;
  chosen.push_back(static_cast<std::size_t>(std::max_element(power.begin(), power.end()) - power.begin()));
  std::vector<double> distance(power.size(), std::numeric_limits<double>::infinity());
  while (chosen.size() < count) {
    std::size_t next = 0;
    double farthest = 0.0;
    for (std::size_t v = 0; v < power.size(); ++v) {
      distance[v] = std::min(distance[v], norm(bank.vertices_m[v] - bank.vertices_m[chosen.back()]));
      if (power[v] > kMinStrikePower * power[chosen[0]] && distance[v] > farthest) farthest = distance[v], next = v;
    }
    if (!(farthest > 0.0)) break;
    chosen.push_back(next);
  }
  return chosen;
}

double calc_ring_s(const Bank& bank, std::size_t vertex) {
  const std::vector<double> amplitudes = calc_blow_amplitudes(bank, vertex, calc_vertex_normals(bank)[vertex]);
  const double loudest = amplitudes.empty() ? 0.0 : *std::max_element(amplitudes.begin(), amplitudes.end());
  double longest = 0.0;
  for (std::size_t m = 0; m < amplitudes.size(); ++m)
    if (amplitudes[m] > kLoudest * loudest) longest = std::max(longest, std::log(1000.0) / bank.decay_per_s[m]);
  return longest;
}

}  // namespace carillon::bank

// Method:     approximately normal numbers, sums of four uniform ones, by a seed and the number of the strike.
// Source:     scatter of strikes by hand, less with practice: "Expertise- and tempo-related performance differences in unimanual drumming",
//             Motor Control 25 (2021) 644.
// Deviations: the amount of scatter is chosen, not measured; strikes are independent.
#include "runtime/synth/variation.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/chance.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::synth {
namespace {

// Standard deviations at variation 1.
constexpr double kEnergyScatter = 0.18;                             // 0.8 dB
constexpr double kTiltScatter = 0.05;                               // rad, about each of two axes: 3 degrees
constexpr double kLengthScatter = 0.05;                             // of the pulse, in addition to the effect of its energy
constexpr double kPlaceScatterM = 2e-3, kPlaceScatterShare = 0.02;  // along the surface, per axis; share of the body's extent

Vec3 calc_extent(const bank::Bank& bank) {
  Vec3 low = bank.vertices_m.front(), high = low;
  for (const Vec3& vertex : bank.vertices_m) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], vertex[k]);
      high[k] = std::max(high[k], vertex[k]);
    }
  }
  return high - low;
}

/// Numbers of mean 0 and variance 1 within 3.5, by seed and strike.
class Chance {
 public:
  Chance(std::uint64_t seed, std::uint64_t strike) : state_(seed + strike * 0xd1342543de82ef95U) {}
  double draw() {
    double sum = 0.0;
    for (int i = 0; i < 4; ++i) sum += 2.0 * base::to_unit(base::draw(state_)) - 1.0;
    return sum * std::sqrt(0.75);
  }

 private:
  std::uint64_t state_;
};

}  // namespace

void vary_strike(const bank::Bank& bank, const std::function<bank::NearestPlace(const Vec3&)>& find, double variation, std::uint64_t seed,
                 std::uint64_t strike, events::Impulse& impulse) {
  if (!(variation > 0.0)) return;
  Chance chance(seed, strike);
  // The mean energy is kept.
  const double energy = 1.0 + variation * kEnergyScatter * chance.draw(), more = std::sqrt(energy);
  const double size = std::sqrt(dot(impulse.impulse_n_s, impulse.impulse_n_s));
  if (size > 0.0) {
    Vec3 axis = impulse.impulse_n_s;
    for (double& x : axis) x /= size;
    const auto [u, v] = find_tangents(axis);
    const double a = variation * kTiltScatter * chance.draw(), b = variation * kTiltScatter * chance.draw();
    const double length = std::sqrt(1.0 + a * a + b * b);
    for (std::size_t k = 0; k < 3; ++k) impulse.impulse_n_s[k] = more * size * (axis[k] + a * u[k] + b * v[k]) / length;
  }
  // Harder hits are shorter (Hertz): tau ~ v^-1/5. Not before the start of the scene.
  impulse.duration_s *= std::pow(more, -0.2) * (1.0 + variation * kLengthScatter * chance.draw());
  impulse.duration_s = std::min(impulse.duration_s, 2.0 * impulse.time_s);
  const auto& corner = bank.triangles[impulse.triangle];
  const Vec3 &p = bank.vertices_m[corner[0]], &q = bank.vertices_m[corner[1]], &r = bank.vertices_m[corner[2]];
  Vec3 normal = cross(q - p, r - p);
  const double area = std::sqrt(dot(normal, normal));
  if (!(area > 0.0)) return;
  for (double& x : normal) x /= area;
  const auto [u, v] = find_tangents(normal);
  const Vec3 extent = calc_extent(bank);
  const double scatter_m = variation * std::min(kPlaceScatterM, kPlaceScatterShare * std::sqrt(dot(extent, extent)));
  const double a = scatter_m * chance.draw(), b = scatter_m * chance.draw();
  Vec3 place{};
  for (std::size_t k = 0; k < 3; ++k) {
    place[k] = impulse.barycentric[0] * p[k] + impulse.barycentric[1] * q[k] + impulse.barycentric[2] * r[k] + a * u[k] + b * v[k];
  }
  const bank::NearestPlace nearest = find(place);
  if (nearest.triangle < 0) return;
  impulse.triangle = nearest.triangle;
  impulse.barycentric = nearest.barycentric;
}

}  // namespace carillon::synth

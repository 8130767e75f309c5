// Method:     the nearest point of a triangle by its Voronoi regions (corners, edges, face), over all triangles. Variation: numbers near
// the
//             normal distribution, sums of four even ones, by the body's name and the number of the strike among its own.
// Source:     Ericson, Real-Time Collision Detection (2005), section 5.1.5. That a hand's strikes scatter, less with practice: "Expertise-
//             and tempo-related performance differences in unimanual drumming", Motor Control 25 (2021) 644.
// Deviations: how much they scatter is chosen, not measured; strikes do not depend on those before.
#include "runtime/host/strikes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/host/planning.hpp"

namespace carillon::host {
namespace {

constexpr double kFarthestShare = 0.25;  // of the body's extent: how far beside the surface a point may lie

// Standard deviations of what strikes of a variation of 1 scatter by.
constexpr double kEnergyScatter = 0.18;                             // 0.8 dB
constexpr double kTiltScatter = 0.05;                               // rad, about each of two axes: 3 degrees
constexpr double kLengthScatter = 0.05;                             // of the pulse, beside what goes with its energy
constexpr double kPlaceScatterM = 2e-3, kPlaceScatterShare = 0.02;  // along the surface, each way; of the body's extent

double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vec3 cross(const Vec3& a, const Vec3& b) { return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}; }
Vec3 subtract(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// Barycentric coordinates of the point of the triangle (a, b, c) that is nearest to p.
Vec3 find_nearest_barycentric(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = subtract(b, a), ac = subtract(c, a);
  const Vec3 ap = subtract(p, a), bp = subtract(p, b), cp = subtract(p, c);
  const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d1 <= 0.0 && d2 <= 0.0) return {1.0, 0.0, 0.0};
  if (d3 >= 0.0 && d4 <= d3) return {0.0, 1.0, 0.0};
  const double over_ab = d1 * d4 - d3 * d2;
  if (over_ab <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return {1.0 - d1 / (d1 - d3), d1 / (d1 - d3), 0.0};
  if (d6 >= 0.0 && d5 <= d6) return {0.0, 0.0, 1.0};
  const double over_ac = d5 * d2 - d1 * d6;
  if (over_ac <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return {1.0 - d2 / (d2 - d6), 0.0, d2 / (d2 - d6)};
  const double over_bc = d3 * d6 - d5 * d4;
  if (over_bc <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0.0, 1.0 - w, w};
  }
  const double sum = over_ab + over_ac + over_bc;
  return {over_bc / sum, over_ac / sum, over_ab / sum};
}

Vec3 calc_extent(const bank::Bank& bank) {
  Vec3 low = bank.vertices_m.front(), high = low;
  for (const Vec3& vertex : bank.vertices_m) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], vertex[k]);
      high[k] = std::max(high[k], vertex[k]);
    }
  }
  return subtract(high, low);
}

/// Puts the impulse on the place of the surface that is nearest to a point; which it returns.
Vec3 find_nearest(const bank::Bank& bank, const Vec3& p, contact::Impulse& impulse) {
  double least = std::numeric_limits<double>::infinity();
  Vec3 nearest{};
  for (std::size_t t = 0; t < bank.triangles.size(); ++t) {
    const auto& corner = bank.triangles[t];
    const Vec3 &a = bank.vertices_m[corner[0]], &b = bank.vertices_m[corner[1]], &c = bank.vertices_m[corner[2]];
    const Vec3 weight = find_nearest_barycentric(p, a, b, c);
    Vec3 place{};
    for (std::size_t k = 0; k < 3; ++k) place[k] = weight[0] * a[k] + weight[1] * b[k] + weight[2] * c[k];
    const Vec3 way = subtract(place, p);
    if (!(dot(way, way) < least)) continue;
    least = dot(way, way);
    nearest = place;
    impulse.triangle = static_cast<std::int32_t>(t);
    impulse.barycentric = weight;
  }
  return nearest;
}

/// The triangle and the place on it that are nearest to the strike's point.
void find_nearest_place(const bank::Bank& bank, const SceneStrike& strike, const std::string& name, contact::Impulse& impulse) {
  const Vec3 nearest = find_nearest(bank, *strike.point_m, impulse), way = subtract(nearest, *strike.point_m), extent = calc_extent(bank);
  const double least = dot(way, way);
  if (!(least <= kFarthestShare * kFarthestShare * dot(extent, extent))) {
    throw InputError(
        fmt::format("{}: \"point_m\" is {:.4g} m away from \"{}\"; its nearest point is [{:.6g}, {:.6g}, {:.6g}] in metres of the mesh",
                    strike.place, std::sqrt(least), name, nearest[0], nearest[1], nearest[2]));
  }
}

/// Numbers of mean 0 and variance 1 within 3.5: the same for the same body and strike.
class Chance {
 public:
  Chance(const SceneBody& body, std::uint64_t strike) : state_(make_surface(body).seed + strike * 0xd1342543de82ef95U) {}
  double draw() {
    double sum = 0.0;
    for (int i = 0; i < 4; ++i) {  // splitmix64 (Steele, Lea and Flood 2014)
      std::uint64_t z = state_ += 0x9e3779b97f4a7c15U;
      z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
      z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
      sum += 2.0 * static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53 - 1.0;
    }
    return sum * std::sqrt(0.75);
  }

 private:
  std::uint64_t state_;
};

/// Changes a strike as a hand would: energy, place, direction and length of the pulse. The mean of the energy stays.
void vary(const bank::Bank& bank, double variation, Chance chance, contact::Impulse& impulse) {
  const double energy = 1.0 + variation * kEnergyScatter * chance.draw(), more = std::sqrt(energy);
  // Any two directions across: first those across the impulse, to turn it.
  const auto make_across = [](const Vec3& axis) {
    const std::size_t least = std::abs(axis[0]) <= std::abs(axis[1]) ? (std::abs(axis[0]) <= std::abs(axis[2]) ? 0 : 2)
                                                                     : (std::abs(axis[1]) <= std::abs(axis[2]) ? 1 : 2);
    Vec3 other{};
    other[least] = 1.0;
    Vec3 u = cross(axis, other);
    const double length = std::sqrt(dot(u, u));
    for (double& x : u) x /= length;
    return std::array<Vec3, 2>{u, cross(axis, u)};
  };
  const double size = std::sqrt(dot(impulse.impulse_n_s, impulse.impulse_n_s));
  if (size > 0.0) {
    Vec3 axis = impulse.impulse_n_s;
    for (double& x : axis) x /= size;
    const auto [u, v] = make_across(axis);
    const double a = variation * kTiltScatter * chance.draw(), b = variation * kTiltScatter * chance.draw();
    const double length = std::sqrt(1.0 + a * a + b * b);
    for (std::size_t k = 0; k < 3; ++k) impulse.impulse_n_s[k] = more * size * (axis[k] + a * u[k] + b * v[k]) / length;
  }
  // A harder hit is shorter, as Hertz has it: tau ~ v^-1/5. It does not begin before the scene.
  impulse.duration_s *= std::pow(more, -0.2) * (1.0 + variation * kLengthScatter * chance.draw());
  impulse.duration_s = std::min(impulse.duration_s, 2.0 * impulse.time_s);
  const auto& corner = bank.triangles[static_cast<std::size_t>(impulse.triangle)];
  const Vec3 &p = bank.vertices_m[corner[0]], &q = bank.vertices_m[corner[1]], &r = bank.vertices_m[corner[2]];
  Vec3 normal = cross(subtract(q, p), subtract(r, p));
  const double area = std::sqrt(dot(normal, normal));
  if (!(area > 0.0)) return;
  for (double& x : normal) x /= area;
  const auto [u, v] = make_across(normal);
  const Vec3 extent = calc_extent(bank);
  const double scatter_m = variation * std::min(kPlaceScatterM, kPlaceScatterShare * std::sqrt(dot(extent, extent)));
  const double a = scatter_m * chance.draw(), b = scatter_m * chance.draw();
  Vec3 place{};
  for (std::size_t k = 0; k < 3; ++k) {
    place[k] = impulse.barycentric[0] * p[k] + impulse.barycentric[1] * q[k] + impulse.barycentric[2] * r[k] + a * u[k] + b * v[k];
  }
  find_nearest(bank, place, impulse);
}

}  // namespace

std::vector<contact::Impulse> make_impulses(const Scene& scene, const std::vector<const bank::Bank*>& banks) {
  std::vector<contact::Impulse> impulses;
  std::vector<std::uint64_t> strikes(scene.bodies.size());  // of each body so far
  for (const SceneStrike& strike : scene.strikes) {
    const bank::Bank& bank = *banks[strike.body];
    const std::string& name = scene.bodies[strike.body].name;
    contact::Impulse impulse{.time_s = strike.time_s,
                             .body = static_cast<std::int32_t>(strike.body),
                             .barycentric = {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0},
                             .impulse_n_s = strike.impulse_n_s,
                             .duration_s = strike.duration_s};
    if (strike.triangle) {
      impulse.triangle = *strike.triangle;
      if (static_cast<std::size_t>(impulse.triangle) >= bank.triangles.size()) {
        throw InputError(fmt::format("{}: \"triangle\" is {}, and \"{}\" has {}; the first is 0", strike.place, impulse.triangle, name,
                                     bank.triangles.size()));
      }
    } else {
      find_nearest_place(bank, strike, name, impulse);
    }
    const double variation = scene.bodies[strike.body].variation;
    const std::uint64_t number = strikes[strike.body]++;
    if (variation > 0.0) vary(bank, variation, Chance(scene.bodies[strike.body], number), impulse);
    impulses.push_back(impulse);
  }
  return impulses;
}

}  // namespace carillon::host

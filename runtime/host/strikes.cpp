// Method:     the nearest place of the surface by runtime/bank/nearest.hpp. Variation: numbers near the normal distribution, sums of four
//             even ones, by the body's name and the number of the strike among its own.
// Source:     that a hand's strikes scatter, less with practice: "Expertise- and tempo-related performance differences in unimanual
//             drumming", Motor Control 25 (2021) 644.
// Deviations: how much they scatter is chosen, not measured; strikes do not depend on those before.
#include "runtime/host/strikes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "runtime/bank/nearest.hpp"
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

/// The nearest places of a bank's surface: by its tree when there are many strikes, which is then worth making.
class Finder {
 public:
  Finder(const bank::Bank& bank, std::size_t strikes) : bank_(&bank) {
    if (strikes >= kStrikesForTree) tree_.emplace(bank);
    low_ = high_ = bank.vertices_m.front();
    for (const Vec3& vertex : bank.vertices_m) {
      for (std::size_t k = 0; k < 3; ++k) {
        low_[k] = std::min(low_[k], vertex[k]);
        high_[k] = std::max(high_[k], vertex[k]);
      }
    }
  }
  bank::NearestPlace find(const Vec3& point_m) const { return tree_ ? tree_->find(point_m) : bank::find_nearest(*bank_, point_m); }
  double get_extent_m() const { return std::hypot(high_[0] - low_[0], high_[1] - low_[1], high_[2] - low_[2]); }

 private:
  static constexpr std::size_t kStrikesForTree = 30;
  const bank::Bank* bank_;
  std::optional<bank::SurfaceTree> tree_;
  Vec3 low_{}, high_{};
};

/// The triangle and the place on it that are nearest to the strike's point.
void find_nearest_place(const Finder& finder, const SceneStrike& strike, const std::string& name, contact::Impulse& impulse) {
  const bank::NearestPlace nearest = finder.find(*strike.point_m);
  if (nearest.triangle < 0) throw InputError(fmt::format("{}: \"point_m\" is too far away; its numbers are too large", strike.place));
  if (!(nearest.distance_m <= kFarthestShare * finder.get_extent_m())) {
    throw InputError(
        fmt::format("{}: \"point_m\" is {:.4g} m away from \"{}\"; its nearest point is [{:.6g}, {:.6g}, {:.6g}] in metres of the mesh",
                    strike.place, nearest.distance_m, name, nearest.point_m[0], nearest.point_m[1], nearest.point_m[2]));
  }
  impulse.triangle = nearest.triangle;
  impulse.barycentric = nearest.barycentric;
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
  const bank::NearestPlace nearest = bank::find_nearest(bank, place);
  if (nearest.triangle < 0) return;
  impulse.triangle = nearest.triangle;
  impulse.barycentric = nearest.barycentric;
}

}  // namespace

std::vector<contact::Impulse> make_impulses(const Scene& scene, const std::vector<const bank::Bank*>& banks) {
  std::map<const bank::Bank*, std::size_t> wanted;  // strikes whose place is to be found
  for (const SceneStrike& strike : scene.strikes) {
    if (!strike.triangle) ++wanted[banks[strike.body]];
  }
  std::map<const bank::Bank*, Finder> finders;
  for (const auto& [bank, strikes] : wanted) finders.try_emplace(bank, *bank, strikes);
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
      find_nearest_place(finders.at(&bank), strike, name, impulse);
    }
    const double variation = scene.bodies[strike.body].variation;
    const std::uint64_t number = strikes[strike.body]++;
    if (variation > 0.0) vary(bank, variation, Chance(scene.bodies[strike.body], number), impulse);
    impulses.push_back(impulse);
  }
  return impulses;
}

}  // namespace carillon::host

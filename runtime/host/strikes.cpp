// Method:     the nearest place of the surface by runtime/bank/nearest.hpp; variation by runtime/synth/variation.hpp.
// Source:     none.
// Deviations: none.
#include "runtime/host/strikes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "runtime/bank/nearest.hpp"
#include "runtime/host/planning.hpp"
#include "runtime/synth/variation.hpp"

namespace carillon::host {
namespace {

constexpr double kFarthestShare = 0.25;  // of the body's extent: how far beside the surface a point may lie

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
    if (variation > 0.0) {
      const auto find = [&bank](const Vec3& point_m) { return bank::find_nearest(bank, point_m); };
      synth::vary_strike(bank, find, variation, make_surface(scene.bodies[strike.body]).seed, number, impulse);
    }
    impulses.push_back(impulse);
  }
  return impulses;
}

}  // namespace carillon::host

// Method: nearest point of the surface by runtime/bank/nearest.hpp; variation by runtime/synth/variation.hpp.
#include "runtime/scene/strikes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "runtime/bank/nearest.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/scene/planning.hpp"
#include "runtime/scene/scene_bodies.hpp"
#include "runtime/synth/variation.hpp"

namespace carillon::scene {
namespace {

constexpr double kQuestionedNs = 1.0, kQuestionedJ = 20.0;  // limits of plausible ideal impulses

/// Nearest points of a bank's surface; uses a tree for many strikes.
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
  double get_extent_m() const { return calc_length(high_ - low_); }

 private:
  static constexpr std::size_t kStrikesForTree = 30;
  const bank::Bank* bank_;
  std::optional<bank::SurfaceTree> tree_;
  Vec3 low_{}, high_{};
};

/// Triangle and point on it nearest to the strike's point.
void find_nearest_place(const Finder& finder, const SceneStrike& strike, const std::string& name, events::Impulse& impulse) {
  const bank::NearestPlace nearest = finder.find(*strike.point_m);
  if (nearest.triangle < 0) throw InputError(fmt::format("{}: \"point_m\" is too far away; its numbers are too large", strike.place));
  if (!(nearest.distance_m <= bank::kFarthestShare * finder.get_extent_m())) {
    throw InputError(
        fmt::format("{}: \"point_m\" is {:.4g} m away from \"{}\"; its nearest point is [{:.6g}, {:.6g}, {:.6g}] in metres of the mesh",
                    strike.place, nearest.distance_m, name, nearest.point_m[0], nearest.point_m[1], nearest.point_m[2]));
  }
  impulse.triangle = nearest.triangle;
  impulse.barycentric = nearest.barycentric;
}

/// Velocity of the head before the blow, in the frame of the mesh.
Vec3 find_velocity(const Mallet& mallet, const bank::Bank& bank, std::int32_t triangle) {
  Vec3 way{};
  if (mallet.direction) {
    way = *mallet.direction;
  } else {
    const auto& corners = bank.triangles[triangle];
    const Vec3 &p = bank.vertices_m[corners[0]], &q = bank.vertices_m[corners[1]], &r = bank.vertices_m[corners[2]];
    const Vec3 u = q - p, v = r - p, normal = cross(v, u);  // inwards
    way = (1.0 / std::max(calc_length(normal), 1e-300)) * normal;
  }
  return mallet.speed_m_s * way;
}

/// An ideal impulse excites all modes alike, which no real blow does; warns if it is large.
std::optional<std::string> question_strike(const SceneStrike& strike, const std::string& name, const bank::Bank& bank,
                                           const events::Impulse& impulse) {
  if (strike.duration_s > 0.0) return std::nullopt;
  const double size = calc_length(impulse.impulse_n_s);
  const auto& corners = bank.triangles[impulse.triangle];
  const std::size_t modes = bank.mode_count();
  double energy_j = 0.0;
  for (std::size_t m = 0; m < modes; ++m) {
    double along = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < 3; ++k)
        along += impulse.barycentric[c] * impulse.impulse_n_s[k] * bank.shape[(static_cast<std::size_t>(corners[c]) * modes + m) * 3 + k];
    }
    energy_j += 0.5 * std::pow(along * bank.shape_scale[m], 2);
  }
  if (size < kQuestionedNs && energy_j < kQuestionedJ) return std::nullopt;
  return fmt::format(
      "{}: {:.3g} N s on \"{}\" with a \"duration_s\" of 0 puts {:.3g} J into its modes, all alike, as no blow does; give the time of "
      "contact (0.001 of a wooden mallet, 0.0001 of a steel one), or a \"mallet\" in place of both",
      strike.place, size, name, energy_j);
}

}  // namespace

Strikes make_strikes(const Scene& scene, const std::vector<const bank::Bank*>& banks) {
  std::map<const bank::Bank*, std::size_t> wanted;  // number of strikes whose point must be located
  for (const SceneStrike& strike : scene.strikes) {
    if (!strike.triangle) ++wanted[banks[strike.body]];
  }
  std::map<const bank::Bank*, Finder> finders;
  for (const auto& [bank, strikes] : wanted) finders.try_emplace(bank, *bank, strikes);
  Strikes made;
  std::vector<std::uint64_t> strikes(scene.bodies.size());  // strikes per body so far
  std::map<std::size_t, std::vector<Mallets::Strike>> by_mallet;
  for (const SceneStrike& strike : scene.strikes) {
    const bank::Bank& bank = *banks[strike.body];
    const std::string& name = scene.bodies[strike.body].name;
    events::Impulse impulse{.time_s = strike.time_s,
                            .body = static_cast<std::int32_t>(strike.body),
                            .barycentric = {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0},
                            .impulse_n_s = strike.impulse_n_s,
                            .duration_s = strike.duration_s};
    if (strike.triangle) {
      impulse.triangle = *strike.triangle;
      if (impulse.triangle >= std::ssize(bank.triangles)) {
        throw InputError(fmt::format("{}: \"triangle\" is {}, and \"{}\" has {}; the first is 0", strike.place, impulse.triangle, name,
                                     bank.triangles.size()));
      }
    } else {
      find_nearest_place(finders.at(&bank), strike, name, impulse);
    }
    // Varies the velocity of a head like an impulse.
    if (strike.mallet) impulse.impulse_n_s = find_velocity(*strike.mallet, bank, impulse.triangle);
    const double variation = scene.bodies[strike.body].variation;
    const std::uint64_t number = strikes[strike.body]++;
    if (variation > 0.0) {
      const auto find = [&bank](const Vec3& point_m) { return bank::find_nearest(bank, point_m); };
      synth::vary_strike(bank, find, variation, make_surface(scene.bodies[strike.body]).seed, number, impulse);
    }
    if (strike.mallet) {
      by_mallet[strike.body].push_back({&strike, strike.body, impulse.triangle, impulse.barycentric, impulse.impulse_n_s});
    } else {
      if (auto question = question_strike(strike, name, bank, impulse)) made.warnings.push_back(*question);
      made.events.emplace_back(impulse);
    }
  }
  Mallets mallets;
  for (auto& [body, on_it] : by_mallet)
    mallets.play(scene.bodies[body], *banks[body], std::move(on_it), made.events, made.blows, made.warnings);
  std::stable_sort(made.events.begin(), made.events.end(),
                   [](const events::Event& a, const events::Event& b) { return events::get_time_s(a) < events::get_time_s(b); });
  return made;
}

}  // namespace carillon::scene

#include "runtime/scene/effects/hearing.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/synth/listener.hpp"
#include "runtime/synth/receiver.hpp"

namespace carillon::effects {

Hearing::Hearing(SceneFacts scene) : facts(std::move(scene)) {
  if (facts.listener.empty()) facts.listener.push_back({});
  listener = synth::make_trajectory(facts.listener);
  if (facts.microphones_m.empty()) throw InputError("a choice of effects needs at least one microphone");
  middle = synth::calc_middle(facts.microphones_m);
}

double Hearing::calc_inaudible_db() const {
  return std::min(kInaudibleDb, calc_level_db(loudest_pa2_s) - facts.thresholds.below_loudest_db);
}

double Hearing::calc_quiet_pa(double inaudible_db, double distance_m, std::size_t modes) const {
  return kReferencePa * std::pow(10.0, inaudible_db / 20.0) * distance_m / std::sqrt(std::max(1.0, static_cast<double>(modes)));
}

double Hearing::find_ways(const Vec3& place_m, double time_s) {
  const Vec3 ear = listener.find(time_s).position_m;
  way_m.clear();
  const auto calc_way_m = [&](const Vec3& offset) { return std::max(norm(ear + offset - place_m), synth::kNearestM); };
  for (const Vec3& offset : facts.microphones_m) way_m.push_back(calc_way_m(offset));
  middle_m = calc_way_m(middle);
  return *std::min_element(way_m.begin(), way_m.end());
}

void Hearing::begin_walk(double time_s) {
  constexpr std::size_t kRemembered = 4096;  // waypoints
  has_walk = true;
  const synth::Trajectory known = std::exchange(listener, synth::Trajectory(kRemembered));
  for (std::size_t i = 0; i < known.get_count(); ++i) {
    if (known.get_waypoint(i).time_s <= time_s) listener.push(known.get_waypoint(i));
  }
}

}  // namespace carillon::effects

// The listener of an EffectSelector: its ways to a body, and the levels that it does not hear.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/scene/effects/effect_selector.hpp"

namespace carillon::effects {

inline constexpr double kNever = -std::numeric_limits<double>::infinity();

/// Of a share of exposure.
inline double to_db(double share) { return 10.0 * std::log10(std::max(share, 1e-30)); }

/// The scene of a selector, its listener and its loudest strike so far.
struct Hearing {
  /// Throws InputError without microphones.
  Hearing(SceneFacts scene, const Costs& unit_costs);

  /// Level below which nothing is heard [dB(A)].
  double calc_inaudible_db() const;
  /// Pressure of that level at 1 m [Pa], for each of so many modes together at a distance.
  double calc_quiet_pa(double inaudible_db, double distance_m, std::size_t modes) const;

  /// The ways from a place to every microphone and to their middle, as if sound took no time; the shortest of the microphones.
  double find_ways(const Vec3& place_m, double time_s);
  /// The listener's place by events from now on; its waypoints before that time stay.
  void begin_walk(double time_s);

  SceneFacts facts;
  Costs costs;
  synth::Trajectory listener{1};
  bool has_walk = false;       // given by events
  double loudest_pa2_s = 0.0;  // of all strikes so far
  Vec3 middle{};               // of the microphones
  // Working space of one call.
  std::vector<double> way_m;  // find_ways(): to the microphones
  double middle_m = 0.0;      // and to their middle
  std::vector<double> projection, amplitude_pa;
};

}  // namespace carillon::effects

// Listener of an EffectSelector: distances to a body, inaudible levels.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/scene/effects/effect_selector.hpp"

namespace carillon::effects {

inline constexpr double kNever = -std::numeric_limits<double>::infinity();

/// dB of a share of exposure.
inline double to_db(double share) { return 10.0 * std::log10(std::max(share, 1e-30)); }

/// Scene, listener and loudest strike so far.
struct Hearing {
  /// Throws InputError without microphones.
  explicit Hearing(SceneFacts scene);

  /// Inaudible level [dB(A)].
  double calc_inaudible_db() const;
  /// Pressure at 1 m [Pa] of each of `modes` modes that together have the inaudible level at `distance_m`.
  double calc_quiet_pa(double inaudible_db, double distance_m, std::size_t modes) const;

  /// Sets way_m and middle_m for a place at a time, without travel time; returns the shortest distance to a microphone.
  double find_ways(const Vec3& place_m, double time_s);
  /// From now on the listener moves by events; its waypoints before that time are kept.
  void begin_walk(double time_s);

  SceneFacts facts;
  synth::Trajectory listener{1};
  bool has_walk = false;       // given by events
  double loudest_pa2_s = 0.0;  // largest exposure of a strike so far
  Vec3 middle{};               // of the microphones
  // Results of the last call.
  std::vector<double> way_m;  // distances to the microphones
  double middle_m = 0.0;      // distance to their middle
  std::vector<double> projection, amplitude_pa;
};

}  // namespace carillon::effects

// Where a body or the listener is over time.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/events/events.hpp"

namespace carillon::synth {

struct Waypoint {
  double time_s = 0.0;
  Vec3 position_m{};
  Vec3 velocity_m_s{};
};

/// The last waypoints of something that moves: cubic between them, with their velocities, so that its speed is continuous. Before the first
/// and after the last it rests there. One thread at a time.
class Trajectory {
 public:
  /// Takes memory for `capacity` >= 1 waypoints, of which the oldest are forgotten first.
  explicit Trajectory(std::size_t capacity);

  /// [audio-thread] Adds a waypoint. Two may have one time, before and after an impact; a third replaces the second. False, and nothing has
  /// changed, when it is earlier than the last or not finite.
  bool push(const Waypoint& waypoint) noexcept;

  /// [audio-thread] At the origin, at rest, when there is no waypoint.
  Waypoint find(double time_s) const noexcept;

  bool is_still() const { return count_ < 2; }

  /// How many waypoints it remembers, and one of them: 0 is the oldest.
  std::size_t get_count() const { return count_; }
  const Waypoint& get_waypoint(std::size_t i) const { return get(i); }

  /// [audio-thread] Whether it stays where it is from this time on, as far as is known.
  bool is_still_from(double time_s) const noexcept { return rest_begin_s_ <= time_s; }

 private:
  const Waypoint& get(std::size_t i) const {  // i <= count_; a division would cost more than all the rest
    const std::size_t at = first_ + i;
    return waypoints_[at < waypoints_.size() ? at : at - waypoints_.size()];
  }

  std::vector<Waypoint> waypoints_;  // a ring
  std::size_t first_ = 0, count_ = 0;
  double rest_begin_s_ = -std::numeric_limits<double>::infinity();
};

/// How something is turned over time: between its last attitudes by the shorter way; before the first and after the last it does not turn.
/// One thread at a time.
class Attitude {
 public:
  /// Takes memory for `capacity` >= 1 attitudes, of which the oldest are forgotten first.
  explicit Attitude(std::size_t capacity);

  /// [audio-thread] Adds an attitude, a unit quaternion; one at the time of the last replaces it. One that is earlier is not taken.
  void push(double time_s, const events::Quaternion& rotation) noexcept;

  /// [audio-thread] Not turned when nothing was pushed.
  events::Quaternion find(double time_s) const noexcept;

 private:
  struct Turn {
    double time_s = 0.0;
    events::Quaternion rotation{1.0, 0.0, 0.0, 0.0};
  };
  const Turn& get(std::size_t i) const { return turns_[(first_ + i) % turns_.size()]; }

  std::vector<Turn> turns_;  // a ring
  std::size_t first_ = 0, count_ = 0;
};

/// A vector of something that is turned, in the axes of the world. [any-thread]
Vec3 turn(const events::Quaternion& rotation, const Vec3& x) noexcept;

/// A track through places whose velocities are not known: each takes its own from its neighbours.
struct PathPoint {
  double time_s = 0.0;
  Vec3 position_m{};
};

/// `places` in order of time, at least one; of several at the same time the last counts. Throws InputError otherwise.
Trajectory make_trajectory(std::span<const PathPoint> places);

}  // namespace carillon::synth

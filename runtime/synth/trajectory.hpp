// Trajectories and attitudes of bodies and the listener.
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

/// Last waypoints of a motion: cubic in between, with their velocities, so that the speed is continuous. At rest before the first and after
/// the last. One thread at a time.
class Trajectory {
 public:
  /// Allocates `capacity` >= 1 waypoints; the oldest are dropped first.
  explicit Trajectory(std::size_t capacity);

  /// [audio-thread] Adds a waypoint. Two may have one time, before and after an impact; a third replaces the second. False, without change,
  /// if earlier than the last or not finite.
  bool push(const Waypoint& waypoint) noexcept;

  /// [audio-thread] At rest at the origin without waypoints.
  Waypoint find(double time_s) const noexcept;

  /// [audio-thread] The track jumps at this time; the last one is remembered.
  void cut(double time_s) noexcept { cut_s_ = time_s; }
  bool is_cut(double after_s, double until_s) const noexcept { return after_s < cut_s_ && cut_s_ <= until_s; }

  bool is_still() const { return count_ < 2; }

  /// Remembered waypoints; 0 is the oldest.
  std::size_t get_count() const { return count_; }
  const Waypoint& get_waypoint(std::size_t i) const { return get(i); }

  /// [audio-thread] True if at rest from this time on, as far as known.
  bool is_still_from(double time_s) const noexcept { return rest_begin_s_ <= time_s; }

 private:
  const Waypoint& get(std::size_t i) const {  // i <= count_; avoids a division
    const std::size_t at = first_ + i;
    return waypoints_[at < waypoints_.size() ? at : at - waypoints_.size()];
  }

  std::vector<Waypoint> waypoints_;  // a ring
  std::size_t first_ = 0, count_ = 0;
  double rest_begin_s_ = -std::numeric_limits<double>::infinity(), cut_s_ = rest_begin_s_;
};

/// Rotation over time: shortest path between its last attitudes; constant before the first and after the last. One thread at a time.
class Attitude {
 public:
  /// Allocates `capacity` >= 1 attitudes; the oldest are dropped first.
  explicit Attitude(std::size_t capacity);

  /// [audio-thread] Adds an attitude, a unit quaternion; replaces the last one at the same time. Earlier ones are ignored.
  void push(double time_s, const events::Quaternion& rotation) noexcept;

  /// [audio-thread] Identity without attitudes.
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

/// Rotates a vector into world axes. [any-thread]
Vec3 turn(const events::Quaternion& rotation, const Vec3& x) noexcept;

/// Point of a path without velocities, which follow from the neighbours.
struct PathPoint {
  double time_s = 0.0;
  Vec3 position_m{};
};

/// `places` in order of time, at least one; of several at one time the last counts. Throws InputError otherwise.
Trajectory make_trajectory(std::span<const PathPoint> places);

}  // namespace carillon::synth

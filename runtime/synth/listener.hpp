// The listener with microphones that turn with it.
#pragma once

#include <cstddef>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::synth {

/// Where the listener is over time, and how it is turned. What it keeps true: microphone m, which is at offset o from a listener that is
/// not turned, is at get_track(m) + o, so that receivers need not know of turns; as long as no events::Listener was turned all tracks are
/// one. Between waypoints every microphone goes its own cubic way. [audio-thread] but for the constructor.
class ListenerTracks {
 public:
  /// Takes memory for `capacity` waypoints of each of the microphones [m from the listener] and of their middle.
  ListenerTracks(std::size_t capacity, const std::vector<Vec3>& microphones_m, const Vec3& position_m);

  /// False, and nothing has changed, when it is earlier than the last or not finite.
  bool push(const events::Listener& listener) noexcept;

  const Trajectory& get_track(std::size_t microphone) const noexcept { return is_turned_ ? turned_[microphone].track : centre_; }
  /// Of the middle of the microphones.
  const Trajectory& get_middle_track() const noexcept { return get_track(turned_.size() - 1); }

 private:
  struct Turned {
    Vec3 offset_m{};
    Trajectory track;
  };
  Trajectory centre_;
  std::vector<Turned> turned_;  // of the microphones, then of their middle; empty tracks as long as nothing is turned
  bool is_turned_ = false;
  double last_s_ = 0.0;
  events::Quaternion last_rotation_{1.0, 0.0, 0.0, 0.0};
};

/// The middle of the microphones, where those are who hear a body without two ears.
Vec3 calc_middle(const std::vector<Vec3>& places);

}  // namespace carillon::synth

// Listener: position, rotation, microphones and head.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/synth/floor.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::head {
class Head;
}

namespace carillon::synth {

/// Head that replaces two microphones, left and right, in their middle; or, with an order, the point that Ambisonics replace
/// count_ambisonic_channels() microphones by.
struct ListeningHead {
  std::shared_ptr<const head::Head> head;
  events::Quaternion rotation{1.0, 0.0, 0.0, 0.0};  // of its frame (x forward, y left, z up) for an unrotated listener
  int ambisonic_order = 0;                          // above 0: Ambisonics, and no head

  /// Delay of the sound at the ears [samples].
  int get_latency() const noexcept;
};

/// Rotation of a head with this forward direction and left ear; any lengths, only the part of `left` across `forward` counts. Identity if
/// they define no frame.
events::Quaternion calc_head_rotation(const Vec3& forward, const Vec3& left) noexcept;

/// Rotation of a level head with ears at these places, looking straight ahead, z up.
events::Quaternion calc_level_head_rotation(const Vec3& left_m, const Vec3& right_m) noexcept;

/// Head between microphones, level if there are two, left and right: default rotation of a listener.
ListeningHead make_level_head(std::shared_ptr<const head::Head> head, const std::vector<Vec3>& microphones_m);

/// Listener position and rotation over time. Invariant: microphone m with offset o from an unrotated listener is at get_track(m) + o, so
/// receivers need no rotations; before the first rotated events::Listener all tracks are one. Between waypoints every microphone follows
/// its own cubic. With a floor there are mirrored tracks for the mirrored offsets, with a head its attitude. [audio-thread] except the
/// constructor.
class ListenerTracks {
 public:
  /// Allocates `capacity` waypoints for each microphone [m from the listener] and for their middle.
  ListenerTracks(std::size_t capacity, const std::vector<Vec3>& microphones_m, const Vec3& position_m,
                 const std::optional<Floor>& floor = std::nullopt, const std::optional<ListeningHead>& head = std::nullopt);

  /// False, without change, if earlier than the last or not finite.
  bool push(const events::Listener& listener) noexcept;

  const Trajectory& get_track(std::size_t microphone) const noexcept { return is_turned_ ? turned_[microphone].track : centre_; }
  /// Track of the middle of the microphones.
  const Trajectory& get_middle_track() const noexcept { return get_track(turned_.size() - 1); }
  /// Mirrored track; only with a floor.
  const Trajectory& get_mirrored_track(std::size_t microphone) const noexcept {
    return is_turned_ ? turned_[microphone].mirrored : mirrored_centre_;
  }
  const Trajectory& get_mirrored_middle_track() const noexcept { return get_mirrored_track(turned_.size() - 1); }
  const std::optional<Floor>& get_floor() const noexcept { return floor_; }
  /// World direction in the frame of the head at a time; only with a head.
  Vec3 find_in_head(const Vec3& direction, double time_s) const noexcept;

 private:
  struct Turned {
    Vec3 offset_m{};
    Trajectory track, mirrored;
  };
  void push_mirrored(Trajectory& mirrored, const Waypoint& waypoint) noexcept;

  std::optional<Floor> floor_;
  Trajectory centre_, mirrored_centre_;
  std::vector<Turned> turned_;  // microphones, then their middle; empty tracks before the first rotation
  bool is_turned_ = false;
  events::Quaternion head_rotation_{1.0, 0.0, 0.0, 0.0};
  Attitude attitude_;  // of the listener, with a head
  double last_s_ = 0.0;
  events::Quaternion last_rotation_{1.0, 0.0, 0.0, 0.0};
};

/// Middle of the microphones: position of the only ear of bodies without two ears.
Vec3 calc_middle(const std::vector<Vec3>& places);

}  // namespace carillon::synth

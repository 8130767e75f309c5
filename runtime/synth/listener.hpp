// The listener with microphones, or a head, that turn with it.
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

/// A head in the middle of two microphones, left and right, which it takes the place of.
struct ListeningHead {
  std::shared_ptr<const head::Head> head;
  events::Quaternion rotation{1.0, 0.0, 0.0, 0.0};  // of its frame (x forward, y left, z up), of a listener that is not turned
};

/// How a head is turned that looks forward and has its left ear there; lengths do not matter, and of `left` only what is across `forward`.
/// Not turned where they give no frame.
events::Quaternion calc_head_rotation(const Vec3& forward, const Vec3& left) noexcept;

/// How the head of a listener is turned that has its left and its right ear at these places and looks straight on, z being up.
events::Quaternion calc_level_head_rotation(const Vec3& left_m, const Vec3& right_m) noexcept;

/// This head between microphones, level where those are two, left and right: how a listener is turned that says no more.
ListeningHead make_level_head(std::shared_ptr<const head::Head> head, const std::vector<Vec3>& microphones_m);

/// Where the listener is over time, and how it is turned. Invariant: microphone m, which is at offset o from a listener that is
/// not turned, is at get_track(m) + o, so that receivers need not know of turns; as long as no events::Listener was turned all tracks are
/// one. Between waypoints every microphone goes its own cubic way. With a floor there are the mirrored tracks too, to which the mirrored
/// offsets belong, and with a head its attitude. [audio-thread] but for the constructor.
class ListenerTracks {
 public:
  /// Takes memory for `capacity` waypoints of each of the microphones [m from the listener] and of their middle.
  ListenerTracks(std::size_t capacity, const std::vector<Vec3>& microphones_m, const Vec3& position_m,
                 const std::optional<Floor>& floor = std::nullopt, const std::optional<ListeningHead>& head = std::nullopt);

  /// False, and nothing has changed, when it is earlier than the last or not finite.
  bool push(const events::Listener& listener) noexcept;

  const Trajectory& get_track(std::size_t microphone) const noexcept { return is_turned_ ? turned_[microphone].track : centre_; }
  /// Of the middle of the microphones.
  const Trajectory& get_middle_track() const noexcept { return get_track(turned_.size() - 1); }
  /// The same beyond the floor; for tracks with a floor only.
  const Trajectory& get_mirrored_track(std::size_t microphone) const noexcept {
    return is_turned_ ? turned_[microphone].mirrored : mirrored_centre_;
  }
  const Trajectory& get_mirrored_middle_track() const noexcept { return get_mirrored_track(turned_.size() - 1); }
  const std::optional<Floor>& get_floor() const noexcept { return floor_; }
  /// A direction of the world in the frame of the head as it is turned at a time; with a head only.
  Vec3 find_in_head(const Vec3& direction, double time_s) const noexcept;

 private:
  struct Turned {
    Vec3 offset_m{};
    Trajectory track, mirrored;
  };
  void push_mirrored(Trajectory& mirrored, const Waypoint& waypoint) noexcept;

  std::optional<Floor> floor_;
  Trajectory centre_, mirrored_centre_;
  std::vector<Turned> turned_;  // of the microphones, then of their middle; empty tracks as long as nothing is turned
  bool is_turned_ = false;
  events::Quaternion head_rotation_{1.0, 0.0, 0.0, 0.0};
  Attitude attitude_;  // of the listener, where there is a head
  double last_s_ = 0.0;
  events::Quaternion last_rotation_{1.0, 0.0, 0.0, 0.0};
};

/// The middle of the microphones, where those are who hear a body without two ears.
Vec3 calc_middle(const std::vector<Vec3>& places);

}  // namespace carillon::synth

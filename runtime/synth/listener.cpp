// Method:     track k is the listener's place plus R o - o for the microphone's offset o, at every waypoint exactly; in between cubic. The
//             speed that a turn gives is that of the chord between the last two waypoints.
// Source:     textbook.
// Deviations: none.
#include "runtime/synth/listener.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/vector.hpp"

namespace carillon::synth {
namespace {

constexpr events::Quaternion kNotTurned{1.0, 0.0, 0.0, 0.0};

}  // namespace

Vec3 calc_middle(const std::vector<Vec3>& places) {
  Vec3 middle{};
  for (const Vec3& place : places)
    for (std::size_t k = 0; k < 3; ++k) middle[k] += place[k] / static_cast<double>(places.size());
  return middle;
}

ListenerTracks::ListenerTracks(std::size_t capacity, const std::vector<Vec3>& microphones_m, const Vec3& position_m,
                               const std::optional<Floor>& floor)
    : floor_(floor), centre_(capacity), mirrored_centre_(floor ? capacity : 1) {
  const auto add = [&](const Vec3& place) { turned_.push_back({place, Trajectory(capacity), Trajectory(floor_ ? capacity : 1)}); };
  for (const Vec3& place : microphones_m) add(place);
  add(calc_middle(microphones_m));
  centre_.push({.position_m = position_m});
  push_mirrored(mirrored_centre_, {.position_m = position_m});
}

/// A cubic way through mirrored waypoints is the mirrored way. Does nothing without a floor.
void ListenerTracks::push_mirrored(Trajectory& mirrored, const Waypoint& waypoint) noexcept {
  if (floor_) mirrored.push({waypoint.time_s, floor_->mirror(waypoint.position_m), floor_->mirror_direction(waypoint.velocity_m_s)});
}

bool ListenerTracks::push(const events::Listener& listener) noexcept {
  double square = 0.0;
  for (const double x : listener.rotation) square += x * x;
  if (!std::isfinite(square) || !centre_.push({listener.time_s, listener.position_m, listener.velocity_m_s})) return false;
  push_mirrored(mirrored_centre_, {listener.time_s, listener.position_m, listener.velocity_m_s});
  if (!is_turned_ && listener.rotation != kNotTurned) {
    is_turned_ = true;
    // The waypoint is in centre_ already; it comes again, and of two at one time the last counts.
    for (Turned& one : turned_)
      for (std::size_t i = 0; i + 1 < centre_.get_count(); ++i) {
        one.track.push(centre_.get_waypoint(i));
        push_mirrored(one.mirrored, centre_.get_waypoint(i));
      }
  }
  const double since_s = listener.time_s - last_s_;
  for (Turned& one : turned_) {
    if (!is_turned_) break;
    const Vec3 now = turn(listener.rotation, one.offset_m), before = turn(last_rotation_, one.offset_m);
    const Vec3 speed = since_s > 0.0 ? (1.0 / since_s) * (now - before) : Vec3{};
    const Waypoint waypoint{listener.time_s, listener.position_m + (now - one.offset_m), listener.velocity_m_s + speed};
    one.track.push(waypoint);
    push_mirrored(one.mirrored, waypoint);
  }
  last_s_ = listener.time_s;
  last_rotation_ = listener.rotation;
  return true;
}

}  // namespace carillon::synth

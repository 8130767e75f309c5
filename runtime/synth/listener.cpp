// Method:     track k is the listener position plus R o - o for the microphone's offset o, exact at every waypoint; cubic in between. The
//             velocity of a rotation is that of the chord between the last two waypoints.
#include "runtime/synth/listener.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/acoustics/head/head.hpp"
#include "runtime/base/quaternion.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::synth {
namespace {

constexpr events::Quaternion kNotTurned{1.0, 0.0, 0.0, 0.0};

Vec3 turn_back(const events::Quaternion& rotation, const Vec3& x) noexcept { return turn(find_inverse(rotation), x); }

}  // namespace

int ListeningHead::get_latency() const noexcept { return head ? head->get_latency() : 0; }

events::Quaternion calc_head_rotation(const Vec3& forward, const Vec3& left) noexcept {
  const double length = norm(forward);
  if (!(length > 0.0) || !std::isfinite(length)) return kNotTurned;
  const Vec3 x = (1.0 / length) * forward, across = left - dot(left, x) * x;
  const double width = norm(across);
  if (!(width > 0.0) || !std::isfinite(width)) return kNotTurned;
  const Vec3 y = (1.0 / width) * across, z = cross(x, y);
  // Quaternion of the matrix of columns x, y, z: the largest of four times the squares of its parts first, since it is positive.
  const std::array<double, 4> squares{1.0 + x[0] + y[1] + z[2], 1.0 + x[0] - y[1] - z[2], 1.0 - x[0] + y[1] - z[2],
                                      1.0 - x[0] - y[1] + z[2]};
  events::Quaternion rotation{};
  const std::size_t largest = std::max_element(squares.begin(), squares.end()) - squares.begin();
  switch (largest) {
    case 0:
      rotation = {squares[0], y[2] - z[1], z[0] - x[2], x[1] - y[0]};
      break;
    case 1:
      rotation = {y[2] - z[1], squares[1], y[0] + x[1], z[0] + x[2]};
      break;
    case 2:
      rotation = {z[0] - x[2], y[0] + x[1], squares[2], z[1] + y[2]};
      break;
    default:
      rotation = {x[1] - y[0], z[0] + x[2], z[1] + y[2], squares[3]};
  }
  double square = 0.0;
  for (const double part : rotation) square += part * part;
  for (double& part : rotation) part /= std::sqrt(square);
  return rotation;
}

events::Quaternion calc_level_head_rotation(const Vec3& left_m, const Vec3& right_m) noexcept {
  const Vec3 left = left_m - right_m;
  return calc_head_rotation(cross(left, {0.0, 0.0, 1.0}), left);
}

ListeningHead make_level_head(std::shared_ptr<const head::Head> head, const std::vector<Vec3>& microphones_m) {
  ListeningHead listening{.head = std::move(head)};
  if (microphones_m.size() == 2) listening.rotation = calc_level_head_rotation(microphones_m[0], microphones_m[1]);
  return listening;
}

Vec3 calc_middle(const std::vector<Vec3>& places) {
  Vec3 middle{};
  for (const Vec3& place : places)
    for (std::size_t k = 0; k < 3; ++k) middle[k] += place[k] / static_cast<double>(places.size());
  return middle;
}

ListenerTracks::ListenerTracks(std::size_t capacity, const std::vector<Vec3>& microphones_m, const Vec3& position_m,
                               const std::optional<Floor>& floor, const std::optional<ListeningHead>& head)
    : floor_(floor), centre_(capacity), mirrored_centre_(floor ? capacity : 1), attitude_(head ? capacity : 1) {
  const auto add = [&](const Vec3& place) { turned_.push_back({place, Trajectory(capacity), Trajectory(floor_ ? capacity : 1)}); };
  for (const Vec3& place : microphones_m) add(place);
  add(calc_middle(microphones_m));
  centre_.push({.position_m = position_m});
  push_mirrored(mirrored_centre_, {.position_m = position_m});
  if (head) head_rotation_ = head->rotation;
  attitude_.push(0.0, kNotTurned);
}

Vec3 ListenerTracks::find_in_head(const Vec3& direction, double time_s) const noexcept {
  return turn_back(head_rotation_, turn_back(attitude_.find(time_s), direction));
}

/// A cubic through mirrored waypoints is the mirrored cubic. No effect without a floor.
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
    // The waypoint is already in centre_; of two at one time the last counts.
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
  attitude_.push(listener.time_s, listener.rotation);
  last_s_ = listener.time_s;
  last_rotation_ = listener.rotation;
  return true;
}

}  // namespace carillon::synth

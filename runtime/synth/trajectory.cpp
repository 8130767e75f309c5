// Method:     cubic Hermite segments; missing velocities are the slopes between the neighbours.
#include "runtime/synth/trajectory.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/error.hpp"

namespace carillon::synth {

Trajectory::Trajectory(std::size_t capacity) : waypoints_(std::max<std::size_t>(capacity, 1)) {}

bool Trajectory::push(const Waypoint& waypoint) noexcept {
  bool finite = std::isfinite(waypoint.time_s);
  for (std::size_t k = 0; k < 3; ++k) finite = finite && std::isfinite(waypoint.position_m[k]) && std::isfinite(waypoint.velocity_m_s[k]);
  if (!finite) return false;
  constexpr Vec3 kRest{};
  if (count_ > 0) {
    const Waypoint& before = get(count_ - 1);
    const double last = before.time_s;
    if (waypoint.time_s < last) return false;
    const bool rests = waypoint.position_m == before.position_m && waypoint.velocity_m_s == kRest && before.velocity_m_s == kRest;
    if (!rests) rest_begin_s_ = waypoint.time_s;
    if (waypoint.time_s == last) {
      const Waypoint& same = get(count_ - 1);
      if (waypoint.position_m == same.position_m && waypoint.velocity_m_s == same.velocity_m_s) return true;
      if (count_ > 1 && get(count_ - 2).time_s == last) --count_;
    }
  }
  if (count_ == waypoints_.size()) {
    first_ = (first_ + 1) % waypoints_.size();
    --count_;
  }
  waypoints_[(first_ + count_) % waypoints_.size()] = waypoint;
  ++count_;
  return true;
}

Waypoint Trajectory::find(double time_s) const noexcept {
  if (count_ == 0) return {.time_s = time_s};
  if (!(time_s > get(0).time_s)) return {time_s, get(0).position_m, {}};
  if (time_s >= get(count_ - 1).time_s) return {time_s, get(count_ - 1).position_m, {}};
  std::size_t low = 0, high = count_ - 1;  // get(low).time_s <= time_s < get(high).time_s
  // Guess for evenly spaced waypoints.
  const double place = (time_s - get(0).time_s) / (get(high).time_s - get(0).time_s) * static_cast<double>(high);
  const std::size_t guess = place < static_cast<double>(high) ? static_cast<std::size_t>(place) : high - 1;
  if (get(guess).time_s <= time_s) {
    low = guess;
    if (get(guess + 1).time_s > time_s) high = guess + 1;
  } else {
    high = guess;
  }
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    (get(middle).time_s <= time_s ? low : high) = middle;
  }
  const Waypoint &a = get(low), &b = get(high);
  const double width = b.time_s - a.time_s;
  const double u = (time_s - a.time_s) / width;
  const double h01 = u * u * (3.0 - 2.0 * u), slope01 = 6.0 * u * (1.0 - u) / width;
  const double h10 = u * (1.0 - u) * (1.0 - u) * width, slope10 = (1.0 - u) * (1.0 - 3.0 * u);
  const double h11 = -u * u * (1.0 - u) * width, slope11 = u * (3.0 * u - 2.0);
  Waypoint here{.time_s = time_s};
  for (std::size_t k = 0; k < 3; ++k) {
    const double step = b.position_m[k] - a.position_m[k];
    here.position_m[k] = a.position_m[k] + h01 * step + h10 * a.velocity_m_s[k] + h11 * b.velocity_m_s[k];
    here.velocity_m_s[k] = slope01 * step + slope10 * a.velocity_m_s[k] + slope11 * b.velocity_m_s[k];
  }
  return here;
}

Attitude::Attitude(std::size_t capacity) : turns_(std::max<std::size_t>(capacity, 1)) {}

void Attitude::push(double time_s, const events::Quaternion& rotation) noexcept {
  if (count_ > 0) {
    const double last = get(count_ - 1).time_s;
    if (time_s < last) return;
    if (time_s == last) --count_;
  }
  if (count_ == turns_.size()) {
    first_ = (first_ + 1) % turns_.size();
    --count_;
  }
  turns_[(first_ + count_) % turns_.size()] = {time_s, rotation};
  ++count_;
}

events::Quaternion Attitude::find(double time_s) const noexcept {
  if (count_ == 0) return {1.0, 0.0, 0.0, 0.0};
  if (!(time_s > get(0).time_s)) return get(0).rotation;
  if (time_s >= get(count_ - 1).time_s) return get(count_ - 1).rotation;
  std::size_t low = 0, high = count_ - 1;
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    (get(middle).time_s <= time_s ? low : high) = middle;
  }
  const Turn &a = get(low), &b = get(high);
  const double u = (time_s - a.time_s) / (b.time_s - a.time_s);
  double dot = 0.0, norm = 0.0;
  for (std::size_t k = 0; k < 4; ++k) dot += a.rotation[k] * b.rotation[k];
  events::Quaternion here{};
  for (std::size_t k = 0; k < 4; ++k) {
    here[k] = (1.0 - u) * a.rotation[k] + (dot < 0.0 ? -u : u) * b.rotation[k];
    norm += here[k] * here[k];
  }
  for (double& x : here) x /= std::sqrt(norm);
  return here;
}

Vec3 turn(const events::Quaternion& rotation, const Vec3& x) noexcept {
  const auto [w, a, b, c] = rotation;
  // x + 2 w (v cross x) + 2 v cross (v cross x), v = (a, b, c).
  const Vec3 t{2.0 * (b * x[2] - c * x[1]), 2.0 * (c * x[0] - a * x[2]), 2.0 * (a * x[1] - b * x[0])};
  return {x[0] + w * t[0] + b * t[2] - c * t[1], x[1] + w * t[1] + c * t[0] - a * t[2], x[2] + w * t[2] + a * t[1] - b * t[0]};
}

Trajectory make_trajectory(std::span<const PathPoint> places) {
  std::vector<Waypoint> waypoints;
  for (const PathPoint& place : places) {
    const bool finite = std::isfinite(place.time_s) && std::isfinite(place.position_m[0]) && std::isfinite(place.position_m[1]) &&
                        std::isfinite(place.position_m[2]);
    if (!finite || (!waypoints.empty() && place.time_s < waypoints.back().time_s)) {
      throw InputError("a path must be finite and in order of time");
    }
    if (!waypoints.empty() && place.time_s == waypoints.back().time_s) waypoints.pop_back();
    waypoints.push_back({place.time_s, place.position_m, {}});
  }
  if (waypoints.empty()) throw InputError("a path needs at least one point");
  for (std::size_t i = 0; waypoints.size() > 1 && i < waypoints.size(); ++i) {
    const Waypoint& before = waypoints[i == 0 ? 0 : i - 1];
    const Waypoint& after = waypoints[std::min(i + 1, waypoints.size() - 1)];
    for (std::size_t k = 0; k < 3; ++k) {
      waypoints[i].velocity_m_s[k] = (after.position_m[k] - before.position_m[k]) / (after.time_s - before.time_s);
    }
  }
  Trajectory track(waypoints.size());
  for (const Waypoint& waypoint : waypoints) track.push(waypoint);
  return track;
}

}  // namespace carillon::synth

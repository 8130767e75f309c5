// Whole runs of a world, and its events as pulses and paths.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

#include "runtime/base/error.hpp"
#include "runtime/physics/world.hpp"

namespace carillon::physics {

Pose calc_pose(const events::BodyMotion& motion, const Vec3& c) {
  const auto& q = motion.rotation;
  const Vec3 u{q[1], q[2], q[3]};
  const Vec3 t = cross(u, c), s = cross(u, t);
  Pose pose{motion.time_s, motion.position_m, q};
  for (std::size_t k = 0; k < 3; ++k) pose.position_m[k] -= c[k] + 2.0 * (q[0] * t[k] + s[k]);
  return pose;
}

Simulation collect(const std::vector<events::Event>& events, const std::vector<Vec3>& centres_m) {
  Simulation all;
  all.poses.resize(centres_m.size());
  const auto is_known = [&](std::int32_t body) { return body >= 0 && body < std::ssize(centres_m); };
  for (const events::Event& event : events) {
    if (const auto* impulse = std::get_if<Impulse>(&event); impulse != nullptr && is_known(impulse->body)) {
      all.impulses.push_back(*impulse);
    } else if (const auto* motion = std::get_if<events::BodyMotion>(&event); motion != nullptr && is_known(motion->body)) {
      const std::size_t body = motion->body;
      auto& path = all.poses[body];
      if (!path.empty() && path.back().time_s >= motion->time_s) continue;  // after an impact the pose is unchanged
      path.push_back(calc_pose(*motion, centres_m[body]));
    }
  }
  const auto earlier = [](const Impulse& x, const Impulse& y) { return x.time_s < y.time_s; };
  std::stable_sort(all.impulses.begin(), all.impulses.end(), earlier);
  return all;
}

Simulation simulate(const WorldSpec& spec, double duration_s, const std::function<void(double)>& progress) {
  if (!(duration_s >= 0.0 && std::isfinite(duration_s)))
    throw InputError(fmt::format("the duration {} s must be a finite number, 0 or more", duration_s));
  World world(spec, {.end_s = duration_s, .lasting_contacts = false});
  std::vector<events::Event> events;
  constexpr int kParts = 100;
  for (int part = 1; part <= kParts; ++part) {
    world.advance(duration_s * part / kParts, std::numeric_limits<double>::infinity(),
                  [&](const events::Event& event) { events.push_back(event); });
    if (progress) progress(static_cast<double>(part) / kParts);
  }
  std::vector<Vec3> centres_m;
  for (const BodySpec& body : spec.bodies) centres_m.push_back(body.bank->rigid.centre_m);
  Simulation all = collect(events, centres_m);
  all.steps = world.get_statistics().steps;
  return all;
}

}  // namespace carillon::physics

// Steps of an engine, written by hand, for drive::Touches.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "runtime/base/chance.hpp"
#include "runtime/drive/touches.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::drive::tests {

constexpr double kGravity = 9.81;

/// Bodies, their poses, and the events of their Touches.
class Rig {
 public:
  explicit Rig(const TouchesOptions& options = {})
      : touches(options, [this](const events::Event& event) {
          if (const char* fault = events::find_fault(event)) faults.emplace_back(fault);
          if (events::get_time_s(event) < mark_s) faults.emplace_back("an event before the mark");
          if (const auto* mark = std::get_if<events::TimeWatermark>(&event)) mark_s = mark->time_s;
          events.push_back(event);
          return true;
        }) {}

  int add(const bank::Bank& bank, const std::string& name, const Vec3& centre_m, const Vec3& velocity_m_s = {}, double restitution = 0.5) {
    const int index = touches.add(
        {.body = touches.count(), .bank = &bank, .name_hash = base::hash_name(name), .restitution = restitution, .friction = 0.5});
    poses.resize(touches.count());
    poses[index] = {.position_m = centre_m, .velocity_m_s = velocity_m_s};
    return index;
  }
  void start() { touches.start(time_s, poses); }
  void step(double dt_s, const std::vector<TouchPoint>& points) {
    time_s += dt_s;
    touches.step(time_s, poses, points);
  }
  /// Events of one kind.
  template <class Kind>
  std::vector<Kind> list() const {
    std::vector<Kind> all;
    for (const events::Event& event : events)
      if (const auto* one = std::get_if<Kind>(&event)) all.push_back(*one);
    return all;
  }
  /// Total of pulses and forces on a body, its mesh axes [N s].
  Vec3 sum_impulses(int body) const {
    Vec3 sum{};
    for (const auto& pulse : list<events::Impulse>())
      if (pulse.body == body) sum = sum + pulse.impulse_n_s;
    for (const auto& force : list<events::Force>())
      if (force.body == body) sum = sum + events::calc_impulse(force);
    return sum;
  }
  bool has_hits() const { return !list<events::Impulse>().empty() || !list<events::Force>().empty(); }

  double time_s = 0.0, mark_s = -1.0;
  std::vector<TouchesPose> poses;
  std::vector<events::Event> events;
  std::vector<std::string> faults;
  Touches touches;
};

/// A point of body `a` on the ground at height 0.
inline TouchPoint on_ground(int a, const Vec3& where_m, double impulse_n_s, const Vec3& friction_n_s = {}) {
  return {.a = a, .b = -1, .point_m = where_m, .normal = {0, 0, 1}, .gap_m = 0.0, .impulse_n_s = impulse_n_s, .friction_n_s = friction_n_s};
}

/// The four lower corners of a box of half the sizes `half_m`, each with a quarter of the impulse.
inline std::vector<TouchPoint> on_four_corners(int body, const Vec3& centre_m, const Vec3& half_m, double impulse_n_s) {
  std::vector<TouchPoint> points;
  for (const double x : {-1.0, 1.0})
    for (const double y : {-1.0, 1.0})
      points.push_back(on_ground(body, {centre_m[0] + x * half_m[0], centre_m[1] + y * half_m[1], 0.0}, 0.25 * impulse_n_s));
  return points;
}

/// A ball of this radius [m] bounces on the ground with restitution 0.5 in 3,000 steps of random length, 1e-7 to 1/30 s. Returns the
/// impulse of its hits without its weight [N s].
inline double bounce_in_random_steps(Rig& rig, const bank::Bank& ball, double radius_m, unsigned seed) {
  std::mt19937 chance(seed);
  std::uniform_real_distribution<double> exponent(std::log(1e-7), std::log(1.0 / 30.0));
  rig.add(ball, "ball", {0, 0, 0.2}, {0, 0, -0.5});
  rig.start();
  const double mass = ball.rigid.mass_kg;
  double given = 0.0;
  for (int n = 0; n < 3000; ++n) {
    const double dt = std::exp(exponent(chance));
    auto& pose = rig.poses[0];
    const double before = pose.velocity_m_s[2];
    double after = before - kGravity * dt, impulse = 0.0;
    if (pose.position_m[2] <= radius_m && after < 0.0) {
      const double wanted = before < -0.1 ? -0.5 * before : 0.0;
      impulse = mass * (wanted - after);
      if (before < -0.1) given += mass * (wanted - before);
      after = wanted;
    }
    const Vec3 where{0, 0, pose.position_m[2] - radius_m};
    pose.velocity_m_s[2] = after;
    pose.position_m[2] = std::max(radius_m - 1e-3, pose.position_m[2] + dt * after);
    std::vector<TouchPoint> points;
    if (impulse > 0.0) points.push_back(on_ground(0, where, impulse));
    rig.step(dt, points);
  }
  return given;
}

}  // namespace carillon::drive::tests

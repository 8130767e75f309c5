// Bodies of tests, and worlds that run past the time at which all should rest.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "runtime/physics/world.hpp"
#include "tests/unit/runtime/physics/checks.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {

/// Invented modes on the surface of a bank: every vertex moves in a direction of its own.
inline bank::Bank add_modes(bank::Bank bank, int modes) {
  for (int m = 0; m < modes; ++m) {
    const double omega = 2.0 * M_PI * 300.0 * std::pow(1.13, m);
    bank.eigenvalue_rad2_s2.push_back(omega * omega);
    bank.decay_per_s.push_back(2.0 + 1e-6 * omega);
    bank.residual.push_back(1e-10);
    bank.radiation_gain.push_back(1.0);
    bank.shape_scale.push_back(1.0 / 32767.0);
  }
  const std::size_t count = bank.vertices_m.size() * static_cast<std::size_t>(modes) * 3;
  for (std::size_t i = 0; i < count; ++i) bank.shape.push_back(static_cast<std::int16_t>(32767.0 * std::sin(1.7 * static_cast<double>(i))));
  return bank;
}

inline BodySpec make_body(std::string name, const bank::Bank& bank, const Vec3& position, double restitution = 0.3) {
  BodySpec body;
  body.name = std::move(name);
  body.bank = &bank;
  body.initial.position_m = position;
  body.restitution = restitution;
  return body;
}

struct Course {
  std::vector<events::BodyMotion> at_begin, at_end;  // of each body: after `settled_s`, and the last
  double last_hit_s = 0.0;
  std::int64_t steps = 0;  // after settled_s
};

inline Course run(const WorldSpec& spec, double settled_s, double end_s) {
  World world(spec, {.end_s = end_s, .lasting_contacts = false});
  Course course;
  course.at_end.resize(spec.bodies.size());
  const auto take = [&](const events::Event& e) {
    if (const auto* m = std::get_if<events::BodyMotion>(&e)) course.at_end[m->body] = *m;
    if (const auto* i = std::get_if<Impulse>(&e)) course.last_hit_s = i->time_s;
  };
  const double forever = std::numeric_limits<double>::infinity();
  world.advance(settled_s, forever, take);
  course.at_begin = course.at_end;
  const std::int64_t steps = world.get_statistics().steps;
  world.advance(end_s, forever, take);
  course.steps = world.get_statistics().steps - steps;
  return course;
}

inline double calc_drift(const Course& course) {
  double drift = 0.0;
  for (std::size_t i = 0; i < course.at_end.size(); ++i)
    drift = std::max(drift, norm(course.at_end[i].position_m - course.at_begin[i].position_m));
  return drift;
}

/// Events of a world with an audit of its energy.
struct Outcome {
  std::vector<events::Event> events;
  std::vector<events::Force> forces;
  int impulses = 0;
  EnergyAudit energy;
};

inline Outcome run_audited(const WorldSpec& spec, double end_s) {
  World world(spec, {.end_s = end_s, .audits_energy = true});
  Outcome outcome;
  world.advance(end_s, std::numeric_limits<double>::infinity(), [&](const events::Event& event) {
    EXPECT_EQ(events::find_fault(event), nullptr);
    outcome.events.push_back(event);
    if (const auto* force = std::get_if<events::Force>(&event)) outcome.forces.push_back(*force);
    if (std::holds_alternative<events::Impulse>(event)) ++outcome.impulses;
  });
  outcome.energy = world.get_statistics().energy;
  return outcome;
}

inline events::BodyMotion find_last(const Outcome& outcome, int body, double before_s = 1e9) {
  events::BodyMotion last;
  for (const events::Event& event : outcome.events)
    if (const auto* m = std::get_if<events::BodyMotion>(&event); m != nullptr && m->body == body && m->time_s <= before_s) last = *m;
  return last;
}

}  // namespace carillon::physics::tests

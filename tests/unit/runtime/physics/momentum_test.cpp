// Every change of a body's velocity has its pulse.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "tests/unit/runtime/physics/checks.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {
namespace {

constexpr double kGravity = 9.81;
constexpr double kApart = 4e-4;    // s
constexpr double kUnheard = 8e-4;  // m/s; four spots of an impact that each give less than 0.2 mm/s to the body there
constexpr double kGentlest =
    0.13;  // m/s; a body that hops over its own corners slower than 0.1 m/s rolls, and is not heard; and friction in 2 ms

std::vector<events::Event> run(const WorldSpec& spec, double end_s) {
  World world(spec, {.end_s = end_s});
  std::vector<events::Event> events;
  world.advance(end_s, std::numeric_limits<double>::infinity(), [&](const events::Event& e) { events.push_back(e); });
  return events;
}

struct Found {
  int jumps = 0;            // instants at which the velocity jumps by more than 1 cm/s
  double worst_jump = 0.0;  // m/s; largest part of a jump without a pulse, beyond the inaudible part
  double worst_rest = 0.0;  // m/s; largest change of velocity between impacts, without gravity
};

/// Goes through the motions of one body. At an impact there are two with one time, before and after.
Found look(const std::vector<events::Event>& events, std::int32_t body, double mass_kg) {
  std::vector<events::BodyMotion> motions;
  std::vector<Impulse> pulses;
  for (const events::Event& e : events) {
    if (const auto* m = std::get_if<events::BodyMotion>(&e); m != nullptr && m->body == body) motions.push_back(*m);
    if (const auto* p = std::get_if<Impulse>(&e); p != nullptr && p->body == body) pulses.push_back(*p);
  }
  Found found;
  for (std::size_t i = 1; i < motions.size(); ++i) {
    const events::BodyMotion &a = motions[i - 1], &b = motions[i];
    const double dt = b.time_s - a.time_s;
    // Bodies that sleep have no motions.
    if (dt > 0.0 && dt < 3e-3)
      found.worst_rest = std::max(found.worst_rest, norm(b.velocity_m_s - a.velocity_m_s + Vec3{0, 0, kGravity * dt}));
  }
  // Impacts so near in time that their pulses overlap are looked at together.
  for (std::size_t i = 1; i < motions.size();) {
    if (motions[i].time_s != motions[i - 1].time_s) {
      ++i;
      continue;
    }
    const double first = motions[i].time_s;
    double last = first;
    Vec3 change{};
    int impacts = 0;
    std::vector<const events::BodyMotion*> turned;  // the body turns by a hundredth between two impacts of one look
    for (; i < motions.size() && motions[i].time_s < last + kApart; ++i) {
      if (motions[i].time_s != motions[i - 1].time_s) continue;
      change = change + mass_kg * (motions[i].velocity_m_s - motions[i - 1].velocity_m_s);
      last = motions[i].time_s;
      turned.push_back(&motions[i]);
      ++impacts;
    }
    Vec3 given{};
    for (const Impulse& p : pulses) {
      const double touch = p.time_s - 0.5 * p.duration_s;
      if (touch < first - 0.5 * kApart || touch > last + 0.5 * kApart) continue;
      const auto nearest = std::min_element(turned.begin(), turned.end(), [&](const auto* a, const auto* b) {
        return std::abs(a->time_s - touch) < std::abs(b->time_s - touch);
      });
      given = given + rotate((*nearest)->rotation, p.impulse_n_s);
    }
    found.jumps += norm(change) > 0.01 * mass_kg ? 1 : 0;
    found.worst_jump = std::max(found.worst_jump, norm(change - given) / mass_kg - kUnheard * impacts - 1e-3 * norm(change) / mass_kg);
  }
  return found;
}

TEST(RandomDrops, NoMissedHit) {
  // 200 boxes and lumpy balls, each dropped by itself, turned and spinning anyhow, with any restitution and friction.
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), plate = make_box({0.1, 0.08, 0.01}), lump = make_eared_ball(0.03, 3);
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  int jumps = 0;
  for (int drop = 0; drop < 200; ++drop) {
    const bank::Bank& bank = drop % 3 == 0 ? box : drop % 3 == 1 ? plate : lump;
    BodySpec b;
    b.name = "dropped";
    b.bank = &bank;
    b.initial.position_m = {0, 0, 0.12 + 0.1 * std::abs(unit(random))};
    b.initial.rotation = {unit(random), unit(random), unit(random), unit(random)};
    b.velocity_m_s = {unit(random), unit(random), unit(random)};
    b.angular_velocity_rad_s = {20 * unit(random), 20 * unit(random), 20 * unit(random)};
    b.restitution = std::abs(unit(random));
    b.friction = std::abs(unit(random));
    WorldSpec w;
    w.ground = GroundSpec{};
    w.ground->restitution = b.restitution;
    w.bodies = {b};
    const auto events = run(w, 0.35);
    const Found found = look(events, 0, bank.rigid.mass_kg);
    jumps += found.jumps;
    EXPECT_LE(found.worst_jump, 0.0) << "drop " << drop;
    EXPECT_LT(found.worst_rest, kGentlest) << "drop " << drop;
  }
  EXPECT_GT(jumps, 400);
}

}  // namespace
}  // namespace carillon::physics::tests

// Hard cases of the contact tracker: synthetic steps of an engine, against their impulses and weights.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>
#include <tuple>

#include "runtime/base/error.hpp"
#include "tests/hard/figure.hpp"
#include "tests/unit/runtime/drive/modal_energy.hpp"
#include "tests/unit/runtime/physics/plate_bank.hpp"

namespace carillon::hard {
namespace {

using drive::TouchesPose;
using drive::TouchPoint;
using drive::tests::kGravity;
using drive::tests::on_four_corners;
using drive::tests::on_ground;
using drive::tests::Rig;
using physics::tests::make_ball;
using physics::tests::make_box;

constexpr double kRadius = 0.03;
const Vec3 kSize{0.1, 0.08, 0.04}, kHalf{0.05, 0.04, 0.02};

/// A resting box after `steps` steps.
Rig& rest(Rig& rig, const bank::Bank& box, double rate_hz, int steps) {
  rig.add(box, "box", {0, 0, kHalf[2]});
  rig.start();
  for (int n = 0; n < steps; ++n) rig.step(1.0 / rate_hz, on_four_corners(0, {}, kHalf, box.rigid.mass_kg * kGravity / rate_hz));
  return rig;
}

std::map<std::uint64_t, double> list_forces(const Rig& rig) {
  std::map<std::uint64_t, double> forces;
  for (const auto& c : rig.list<events::LastingContact>()) {
    if (c.state == events::ContactState::kEnd)
      forces.erase(c.id);
    else
      forces[c.id] = c.force_n;
  }
  return forces;
}

double sum_forces(const Rig& rig) {
  double sum = 0.0;
  for (const auto& [id, force] : list_forces(rig)) sum += force;
  return sum;
}

double count_hits(const Rig& rig) {
  return static_cast<double>(rig.list<events::Impulse>().size() + rig.list<events::Force>().size() + rig.faults.size());
}

/// A ball at 1 m/s that leaves at 0.5 m/s, its force in the given shares of steps. Error of the pulse, relative; other than one pulse: 1.
double play_ball(const std::vector<double>& shares, double dt_s, bool is_compliant) {
  const bank::Bank ball = make_ball(kRadius);
  Rig rig({.compliant = is_compliant});
  rig.add(ball, "ball", {0, 0, kRadius}, {0, 0, -1.0});
  rig.start();
  const double mass = ball.rigid.mass_kg;
  for (const double share : shares) {
    rig.poses[0].velocity_m_s[2] += 1.5 * share;
    rig.step(dt_s, {on_ground(0, {}, mass * (1.5 * share + kGravity * dt_s))});
  }
  for (int n = 0; n < 40; ++n) rig.step(dt_s, {});
  if (rig.list<events::Impulse>().size() != 1 || !rig.faults.empty()) return 1.0;
  return std::abs(rig.sum_impulses(0)[2] / (1.5 * mass) - 1.0);
}

TEST(touches, touch_one_hit) {
  double worst = 0.0;
  for (const int steps : {1, 2, 3, 5, 9, 17, 40})
    worst = std::max(worst, play_ball(std::vector<double>(steps, 1.0 / steps), 1e-3 / steps, steps > 2));
  hold("touch_one_hit", worst, 0.02, "impulse, relative");
}

TEST(touches, touch_compliant) {
  // Half a sine of force over many steps, as engines with a contact spring have it.
  double worst = 0.0;
  for (const double rate_hz : {500.0, 2000.0, 10000.0})
    for (const int steps : {4, 12, 30}) {
      std::vector<double> shares(steps);
      for (int n = 0; n < steps; ++n) shares[n] = 0.5 * (std::cos(M_PI * n / steps) - std::cos(M_PI * (n + 1) / steps));
      worst = std::max(worst, play_ball(shares, 1.0 / rate_hz, true));
    }
  hold("touch_compliant", worst, 0.02, "impulse, relative");
}

TEST(touches, touch_weight) {
  const bank::Bank box = make_box(kSize);
  double hits = 0.0, off = 0.0;
  for (const double rate_hz : {24.0, 60.0, 240.0, 1000.0, 10000.0}) {
    Rig rig;
    rest(rig, box, rate_hz, static_cast<int>(std::max(20.0, 0.1 * rate_hz)));
    hits += count_hits(rig);
    off = std::max(off, std::abs(sum_forces(rig) / (box.rigid.mass_kg * kGravity) - 1.0));
  }
  hold("touch_weight", hits, 0.0, "hits");
  hold("touch_weight", off, 0.03, "weight, relative");
}

TEST(touches, touch_hopping) {
  const bank::Bank box = make_box(kSize);
  const double weight = box.rigid.mass_kg * kGravity;
  double hits = 0.0, off = 0.0, broken = 0.0;
  for (const double rate_hz : {60.0, 240.0, 1000.0}) {
    Rig rig;
    rig.add(box, "box", {0, 0, kHalf[2]});
    rig.start();
    for (int n = 0; n < rate_hz; ++n) rig.step(1.0 / rate_hz, {on_ground(0, {n % 2 == 0 ? 0.05 : -0.05, 0, 0}, weight / rate_hz)});
    hits += count_hits(rig);
    std::set<std::uint64_t> ids;
    for (const auto& c : rig.list<events::LastingContact>()) {
      ids.insert(c.id);
      broken += c.state == events::ContactState::kEnd ? 1.0 : 0.0;
      if (c.time_s > 0.5) off = std::max(off, std::abs(c.force_n / (0.5 * weight) - 1.0));
    }
    broken += std::abs(static_cast<double>(ids.size()) - 2.0);
  }
  hold("touch_hopping", hits + broken, 0.0, "hits, contacts that end");
  hold("touch_hopping", off, 0.15, "force, relative");
}

/// A box on another, struck now and then; `seed` shuffles the points of each step. Pulses and forces.
std::vector<std::tuple<double, int, std::uint64_t, double>> play_stack(const bank::Bank& box, unsigned seed) {
  Rig rig;
  for (int k = 0; k < 2; ++k) rig.add(box, k == 0 ? "low" : "high", {0, 0, kHalf[2] + kSize[2] * k});
  rig.start();
  std::mt19937 chance(seed);
  const double dt = 1.0 / 500.0, weight = box.rigid.mass_kg * kGravity;
  for (int n = 0; n < 100; ++n) {
    std::vector<TouchPoint> points;
    for (int k = 0; k < 2; ++k) {
      rig.poses[k].velocity_m_s[2] = n % 25 == 19 ? -0.2 : 0.0;
      for (TouchPoint p : on_four_corners(k, {}, kHalf, (2 - k) * weight * dt + (n % 25 == 20 ? 0.5 : 0.0))) {
        p.point_m[2] = kSize[2] * k;
        p.b = k - 1;
        if (seed > 1 && p.b >= 0 && chance() % 2 == 0) {  // swaps the pair
          std::swap(p.a, p.b);
          p.normal = -1.0 * p.normal;
        }
        points.push_back(p);
      }
    }
    if (seed != 0) std::shuffle(points.begin(), points.end(), chance);
    rig.step(dt, points);
  }
  std::vector<std::tuple<double, int, std::uint64_t, double>> all;
  for (const auto& p : rig.list<events::Impulse>()) all.emplace_back(p.time_s, p.body, 0, norm(p.impulse_n_s));
  for (const auto& c : rig.list<events::LastingContact>()) all.emplace_back(c.time_s, c.body, c.id, c.force_n);
  EXPECT_TRUE(rig.faults.empty());
  EXPECT_TRUE(rig.has_hits());
  std::sort(all.begin(), all.end());
  return all;
}

TEST(touches, touch_renumbered) {
  const bank::Bank box = make_box(kSize);
  const auto wanted = play_stack(box, 0);
  double differ = 0.0;
  for (unsigned seed = 1; seed < 20; ++seed) differ += play_stack(box, seed) == wanted ? 0.0 : 1.0;
  hold("touch_renumbered", differ, 0.0);
}

TEST(touches, touch_random_steps) {
  const bank::Bank ball = make_ball(kRadius);
  double worst = 0.0, faults = 0.0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    Rig rig;
    const double given = drive::tests::bounce_in_random_steps(rig, ball, kRadius, seed);
    faults += static_cast<double>(rig.faults.size());
    worst = std::max(worst, std::abs(rig.sum_impulses(0)[2] / given - 1.0));
  }
  hold("touch_random_steps", worst, 0.05, "impulse, relative");
  hold("touch_random_steps", faults, 0.0, "events that are invalid or late");
}

TEST(touches, touch_recovery) {
  const bank::Bank box = make_box(kSize);
  double hits = 0.0;
  for (const double rate_hz : {60.0, 240.0, 1000.0})
    for (const double speed : {0.1, 1.0, 3.0}) {
      Rig rig;
      rig.add(box, "box", {0, 0, 0.0});
      rig.start();
      for (int n = 0; n < 5; ++n) {
        rig.poses[0].velocity_m_s[2] = speed;
        rig.poses[0].position_m[2] += speed / rate_hz;
        rig.step(1.0 / rate_hz, on_four_corners(0, {}, kHalf, n == 0 ? speed * box.rigid.mass_kg : 0.0));
      }
      hits += count_hits(rig);
    }
  hold("touch_recovery", hits, 0.0);
}

TEST(touches, touch_many_points) {
  const bank::Bank box = make_box(kSize);
  const double weight = box.rigid.mass_kg * kGravity;
  for (const int count : {4096, 20000}) {
    Rig rig;
    rig.add(box, "box", {0, 0, kHalf[2]});
    rig.start();
    std::vector<TouchPoint> points;
    for (int n = 0; n < count; ++n)
      points.push_back(
          on_ground(0, {-0.05 + 0.1 * (n % 128) / 127.0, -0.04 + 0.08 * (n / 128) / (count / 128 - 1.0), 0.0}, weight / 240.0 / count));
    for (int n = 0; n < 20; ++n) rig.step(1.0 / 240.0, points);
    const auto& counters = rig.touches.get_counters();
    const std::string part = std::to_string(count) + " points";
    hold("touch_many_points", count_hits(rig), 0.0, part + ", hits");
    hold("touch_many_points", std::abs(counters.points / (20.0 * 4096.0) - 1.0) + std::abs(counters.dropped_points / 20.0 - (count - 4096)),
         0.0, part + ", of them lost");
    hold("touch_many_points", sum_forces(rig) / weight, 1.01, part + ", weight carried, relative");
  }
}

TEST(touches, touch_nan) {
  const bank::Bank box = make_box(kSize);
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
  Rig rig;
  rest(rig, box, 240.0, 20);
  const std::size_t events = rig.events.size();
  const double wanted = sum_forces(rig);
  double taken = 0.0;
  for (const double bad : {nan, infinite, -infinite}) {
    for (int field = 0; field < 13; ++field) {
      std::vector<TouchesPose> poses = rig.poses;
      (field < 3   ? poses[0].position_m[field]
       : field < 6 ? poses[0].velocity_m_s[field - 3]
       : field < 9 ? poses[0].spin_rad_s[field - 6]
                   : poses[0].rotation[field - 9]) = bad;
      try {
        rig.touches.step(rig.time_s + 0.01, poses, {});
        ++taken;
      } catch (const InputError&) {
      }
    }
    try {
      rig.touches.step(bad, rig.poses, {});
      ++taken;
    } catch (const InputError&) {
    }
  }
  hold("touch_nan", taken + static_cast<double>(rig.events.size() - events), 0.0, "steps accepted");
  // Bad points among good ones, which still carry the weight.
  std::vector<TouchPoint> points = on_four_corners(0, {}, kHalf, box.rigid.mass_kg * kGravity / 240.0);
  const TouchPoint good = points[0];
  int bad_points = 0;
  for (const double bad : {nan, infinite, -infinite})
    for (int field = 0; field < 11; ++field) {
      TouchPoint p = good;
      (field < 3   ? p.point_m[field]
       : field < 6 ? p.normal[field - 3]
       : field < 7 ? p.gap_m
       : field < 8 ? p.impulse_n_s
                   : p.friction_n_s[field - 8]) = bad;
      if (field >= 7 && (std::isnan(bad) || (field == 7 && bad < 0.0)))
        continue;  // NaN: found from the velocities; a negative impulse counts as 0
      points.push_back(p);
      ++bad_points;
    }
  for (int n = 0; n < 20; ++n) rig.step(1.0 / 240.0, points);
  hold("touch_nan", std::abs(rig.touches.get_counters().bad_points / 20.0 - bad_points), 0.0, "points accepted");
  hold("touch_nan", std::abs(sum_forces(rig) / wanted - 1.0) + count_hits(rig), 0.03, "weight, relative");
}

TEST(touches, touch_thin_plates) {
  double rings = -1.0, pushes = 0.0;
  for (const double thickness : {0.5e-3, 1e-3, 2e-3, 5e-3}) {
    const bank::Bank plate = physics::tests::make_plate_bank(0.2, thickness, 8000.0, 8, 1.0);
    for (const double e : {0.2, 0.5, 0.9})
      for (const int impacts : {8, 0}) {
        Rig rig({.max_impacts = impacts, .ground_restitution = e});
        const auto [blow_j, impulse_n_s] = drive::tests::strike_plate(rig, plate, thickness, e);
        ASSERT_TRUE(rig.has_hits() && rig.faults.empty());
        rings = std::max(rings, drive::tests::calc_modal_j(rig, plate, 0) / blow_j - (1.0 - e * e));
        pushes = std::max(pushes, rig.sum_impulses(0)[2] / impulse_n_s - 1.0);
      }
  }
  hold("touch_thin_plates", rings, 0.01, "energy of modes beyond the loss of the blow, of the blow");
  hold("touch_thin_plates", pushes, 0.01, "impulse beyond that of the engine, relative");
}

TEST(touches, touch_teleports) {
  const bank::Bank box = make_box(kSize);
  const double dt = 1.0 / 240.0, weight = box.rigid.mass_kg * kGravity;
  double hits = 0.0, left = 0.0;
  for (const bool is_told : {true, false}) {
    Rig rig;
    rest(rig, box, 240.0, 20);
    for (int jump = 1; jump <= 5; ++jump) {
      rig.poses[0].position_m[0] = 3.0 * jump;
      rig.poses[0].teleported = is_told;
      for (int n = 0; n < 20; ++n) {
        rig.step(dt, on_four_corners(0, {3.0 * jump, 0, 0}, kHalf, weight * dt));
        rig.poses[0].teleported = false;
      }
    }
    hits += count_hits(rig);
    left += std::abs(static_cast<double>(list_forces(rig).size()) - 4.0);
  }
  hold("touch_teleports", hits, 0.0, "hits");
  hold("touch_teleports", left, 0.0, "contacts left behind");
}

TEST(touches, touch_sleep) {
  const bank::Bank box = make_box(kSize);
  const double dt = 1.0 / 240.0, weight = box.rigid.mass_kg * kGravity;
  Rig rig;
  rest(rig, box, 240.0, 40);
  const auto awake = list_forces(rig);
  double records = 0.0, changed = 0.0;
  for (int nap = 0; nap < 5; ++nap) {
    rig.poses[0].asleep = true;
    rig.events.clear();
    for (int n = 0; n < 100; ++n) rig.step(dt, {});
    records = std::max(records, static_cast<double>(rig.list<events::LastingContact>().size()));
    rig.poses[0].asleep = false;
    rig.events.clear();
    for (int n = 0; n < 20; ++n) rig.step(dt, on_four_corners(0, {}, kHalf, weight * dt));
    for (const auto& c : rig.list<events::LastingContact>())
      changed += awake.contains(c.id) && c.state == events::ContactState::kHold ? 0.0 : 1.0;
    changed += count_hits(rig);
  }
  hold("touch_sleep", records, 4.0, "records of four contacts, 100 steps asleep");
  hold("touch_sleep", changed, 0.0, "hits, new contacts after waking");
}

TEST(touches, touch_jointed) {
  // A ball on a linkage strikes as if it were heavier: the duration of Hertz grows by the power 2/5 of the mass.
  const bank::Bank ball = make_ball(kRadius);
  const auto find_duration = [&](bool is_jointed, double heavier) {
    Rig rig;
    rig.add(ball, "ball", {0, 0, kRadius}, {0, 0, -1.0});
    rig.start();
    rig.poses[0].jointed = is_jointed;
    rig.poses[0].velocity_m_s[2] = 0.5;
    rig.step(1e-4, {on_ground(0, {}, 1.5 * heavier * ball.rigid.mass_kg)});
    for (int n = 0; n < 40; ++n) rig.step(1e-4, {});
    const auto pulses = rig.list<events::Impulse>();
    EXPECT_EQ(pulses.size(), 1U);
    return pulses.empty() ? 0.0 : pulses[0].duration_s;
  };
  const double alone = find_duration(false, 1.0);
  double worst = std::abs(find_duration(true, 1.0) / alone - 1.0);
  for (const double heavier : {2.0, 10.0, 100.0})
    worst = std::max(worst, std::abs(find_duration(true, heavier) / alone / std::pow(heavier, 0.4) - 1.0));
  hold("touch_jointed", worst, 0.02, "duration, relative");
}

}  // namespace
}  // namespace carillon::hard

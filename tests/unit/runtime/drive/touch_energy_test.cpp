// Energy that hits give to modes: never above the loss of kinetic energy.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "tests/unit/runtime/drive/modal_energy.hpp"
#include "tests/unit/runtime/physics/plate_bank.hpp"

namespace carillon::drive::tests {
namespace {

TEST(TouchEnergy, PlatesNeverRingWithMoreThanTheBlow) {
  const double thickness = 1e-3;  // others, and other restitutions: tests/hard
  const bank::Bank plate = physics::tests::make_plate_bank(0.2, thickness, 8000.0, 8, 1.0);
  for (const auto& [impacts, early] : {std::pair{8, false}, {0, false}, {8, true}}) {
    Rig rig({.early = early, .max_impacts = impacts, .ground_restitution = 0.5});
    const auto [blow_j, impulse_n_s] = strike_plate(rig, plate, thickness, 0.5);
    ASSERT_TRUE(rig.has_hits());
    EXPECT_LE(calc_modal_j(rig, plate, 0), 0.76 * blow_j) << impacts << early;
    EXPECT_LE(rig.sum_impulses(0)[2], 1.01 * impulse_n_s);
    EXPECT_TRUE(rig.faults.empty());
    EXPECT_EQ(rig.touches.get_counters().impacts + rig.touches.get_counters().simplified, 1) << "modes matter";
  }
}

/// A plate that falls at `speed` and is struck at both ends at once, so that it leaves with e times the speed; steps of 0.1 ms.
void strike_both_ends(Rig& rig, const bank::Bank& plate, double speed, double e) {
  const double impulse = (1.0 + e) * speed * plate.rigid.mass_kg;
  rig.poses[0].velocity_m_s[2] = -speed;
  rig.step(1e-4, {});
  rig.poses[0].velocity_m_s[2] = e * speed;
  rig.step(1e-4, {on_ground(0, {0.1, 0.0, 0.0}, 0.5 * impulse), on_ground(0, {-0.1, 0.0, 0.0}, 0.5 * impulse)});
  for (int n = 0; n < 300; ++n) rig.step(1e-4, {});
}

TEST(TouchEnergy, BothEndsStrikeTogether) {
  const bank::Bank plate = physics::tests::make_plate_bank(0.2, 5e-3, 8000.0, 8, 1.0);
  const double e = 0.5, speed = 1.0, wanted = (1.0 + e) * speed * plate.rigid.mass_kg;
  for (const bool early : {false, true}) {
    Rig rig({.early = early, .ground_restitution = e});
    rig.add(plate, "plate", {0, 0, 2.5e-3}, {}, e);
    rig.start();
    strike_both_ends(rig, plate, speed, e);
    EXPECT_EQ(rig.touches.get_counters().impacts, 2) << early;
    EXPECT_LE(rig.sum_impulses(0)[2], 1.001 * wanted) << early;
    EXPECT_GE(rig.sum_impulses(0)[2], 0.8 * wanted) << early << ": each alone turns the plate, and gives a quarter";
  }
}

/// The plate of land(), and the impulse with which the engine stops it [N s].
constexpr double kLandingMS = 1.0, kLandingRestitution = 0.5;
const bank::Bank& get_landing_plate() {
  static const bank::Bank plate = physics::tests::make_plate_bank(0.2, 5e-3, 8000.0, 8, 1.0);
  return plate;
}
double calc_landing_n_s() { return (1.0 + kLandingRestitution) * kLandingMS * get_landing_plate().rigid.mass_kg; }

/// Forces of a level plate that strikes a floor by these corners (+-1 in x and y), by triangle and time. `floor`: null for the ground;
/// `floor_x_m`: its centre.
std::vector<events::Force> land(const std::vector<std::pair<int, int>>& corners, const TouchesBody* floor, double floor_x_m = 0.0) {
  constexpr double kHalf = 0.1;
  const bank::Bank& plate = get_landing_plate();
  const double impulse = calc_landing_n_s();
  Rig rig({.ground_restitution = kLandingRestitution});
  rig.add(plate, "plate", {0, 0, 2.5e-3}, {0, 0, -kLandingMS}, kLandingRestitution);
  const int below = floor == nullptr ? -1 : rig.touches.add(*floor);
  rig.poses.resize(rig.touches.count());
  if (floor != nullptr) rig.poses.back().position_m = {floor_x_m, 0, -0.05};
  rig.start();
  rig.step(1e-4, {});
  rig.poses[0].velocity_m_s[2] = kLandingRestitution * kLandingMS;
  std::vector<TouchPoint> points;
  for (const auto& [x, y] : corners) {
    points.push_back(on_ground(0, {x * kHalf, y * kHalf, 0.0}, impulse / static_cast<double>(corners.size())));
    points.back().b = below;
  }
  rig.step(1e-4, points);
  for (int n = 0; n < 300; ++n) rig.step(1e-4, {});
  EXPECT_LE(rig.sum_impulses(0)[2], 1.001 * impulse);
  const double lost_j = 0.5 * plate.rigid.mass_kg * kLandingMS * kLandingMS * (1.0 - kLandingRestitution * kLandingRestitution);
  EXPECT_LE(calc_modal_j(rig, plate, 0), 1.001 * lost_j);
  auto forces = rig.list<events::Force>();
  std::erase_if(forces, [](const events::Force& force) { return force.body != 0; });
  std::sort(forces.begin(), forces.end(),
            [](const auto& x, const auto& y) { return std::pair(x.triangle, x.time_s) < std::pair(y.triangle, y.time_s); });
  return forces;
}

/// Engines may stop a face that lands by two opposite corners: it sounds as with all four.
TEST(TouchEnergy, FaceThatLandsStrikesWithAllItsCorners) {
  const bank::Bank slab = physics::tests::make_box({1.0, 1.0, 0.1}, {4, 4, 1});
  const TouchesBody of_bank{.body = 1, .fixed = true, .bank = &slab, .name_hash = 1, .friction = 0.5},
      silent{.body = -1, .fixed = true, .name_hash = 2, .young_pa = 3e10, .poisson = 0.2, .density_kg_m3 = 2400.0, .size_m = 1.5};
  TouchesBody moving = of_bank, renamed = of_bank;
  moving.fixed = false;
  renamed.name_hash = ~0ULL;  // the other order of the pair
  for (const TouchesBody* floor : std::initializer_list<const TouchesBody*>{nullptr, &of_bank, &silent, &moving, &renamed}) {
    const auto whole = land({{1, 1}, {-1, -1}, {1, -1}, {-1, 1}}, floor), opposite = land({{1, 1}, {-1, -1}}, floor);
    std::map<std::int32_t, double> pushes;  // by corner
    double sum = 0.0;
    for (const events::Force& force : whole) {
      pushes[force.triangle] += events::calc_impulse(force)[2];
      sum += events::calc_impulse(force)[2];
    }
    EXPECT_EQ(pushes.size(), 4U);
    EXPECT_GE(sum, 0.8 * calc_landing_n_s());
    for (const auto& [corner, push] : pushes) EXPECT_NEAR(push, 0.25 * sum, 0.01 * sum) << "or the level plate would turn";
    ASSERT_EQ(opposite.size(), whole.size());
    for (std::size_t k = 0; k < whole.size(); ++k)
      EXPECT_NEAR(events::calc_impulse(opposite[k])[2], events::calc_impulse(whole[k])[2], 1e-3 * sum) << k;
  }
}

/// A spinning plate that lands on one edge, while the other rises: the whole impulse of the engine, on that edge alone.
TEST(TouchEnergy, CornersThatRiseStrikeNothing) {
  constexpr double kHalf = 0.1, kSpeed = 0.2, kSpin = 10.0, kRestitution = 0.5;
  const bank::Bank plate = physics::tests::make_plate_bank(2.0 * kHalf, 5e-3, 8000.0, 8, 1.0);
  const double mass = plate.rigid.mass_kg, inertia = plate.rigid.inertia_kg_m2[4];
  const double impulse = (1.0 + kRestitution) * (kSpeed + kSpin * kHalf) / (1.0 / mass + kHalf * kHalf / inertia);
  Rig rig({.ground_restitution = kRestitution});
  rig.add(plate, "plate", {0, 0, 2.5e-3}, {0, 0, -kSpeed}, kRestitution);
  rig.poses[0].spin_rad_s = {0, kSpin, 0};  // x > 0 goes down
  rig.start();
  rig.step(1e-4, {});
  rig.poses[0].velocity_m_s[2] += impulse / mass;
  rig.poses[0].spin_rad_s[1] -= kHalf * impulse / inertia;
  rig.step(1e-4, {on_ground(0, {kHalf, kHalf, 0.0}, 0.5 * impulse), on_ground(0, {kHalf, -kHalf, 0.0}, 0.5 * impulse)});
  for (int n = 0; n < 300; ++n) rig.step(1e-4, {});
  std::set<std::int32_t> places;
  for (const events::Force& force : rig.list<events::Force>()) places.insert(force.triangle);
  EXPECT_EQ(places.size(), 2U);
  EXPECT_GE(rig.sum_impulses(0)[2], 0.8 * impulse);
  EXPECT_LE(rig.sum_impulses(0)[2], 1.001 * impulse);
}

/// Corners that hang over the edge of a slab strike nothing.
TEST(TouchEnergy, CornersBesideASlabStrikeNothing) {
  const bank::Bank slab = physics::tests::make_box({1.0, 1.0, 0.1}, {4, 4, 1});
  const TouchesBody floor{.body = 1, .fixed = true, .bank = &slab, .name_hash = 1, .friction = 0.5};
  std::set<std::int32_t> places;
  for (const events::Force& force : land({{-1, 1}, {-1, -1}}, &floor, -0.45)) places.insert(force.triangle);
  EXPECT_EQ(places.size(), 2U);
}

TEST(TouchEnergy, ImpactsBeyondTheWorkOfMaxImpactsAreSimplified) {
  constexpr int kPlates = 12;
  const bank::Bank plate = physics::tests::make_plate_bank(0.2, 2e-3, 8000.0, 8, 1.0);
  const double speed = 1.0, e = 0.5, impulse = (1.0 + e) * speed * plate.rigid.mass_kg;
  for (const int most : {1, 4, 100}) {
    Rig rig({.max_impacts = most, .ground_restitution = e});
    for (int i = 0; i < kPlates; ++i) rig.add(plate, "plate" + std::to_string(i), {0.5 * i, 0, 1e-3}, {}, e);
    rig.start();
    const auto strike = [&](int count) {
      std::vector<TouchPoint> points;
      for (int i = 0; i < count; ++i) rig.poses[i].velocity_m_s[2] = -speed;
      rig.step(1e-3, {});
      for (int i = 0; i < count; ++i) {
        rig.poses[i].velocity_m_s[2] = e * speed;
        points.push_back(on_ground(i, {0.5 * i, 0.0, 0.0}, impulse));
      }
      rig.step(1e-3, points);
      for (int n = 0; n < 40; ++n) rig.step(1e-3, {});
    };
    strike(kPlates);
    const TouchesCounters first = rig.touches.get_counters();
    EXPECT_EQ(first.impacts + first.simplified, kPlates) << most;
    EXPECT_GE(first.impacts, 1) << most;
    EXPECT_EQ(first.simplified == 0, most == 100) << most;
    int whole = 0;  // impacts that passed on the impulse of the engine
    for (int i = 0; i < kPlates; ++i) {
      EXPECT_LE(rig.sum_impulses(i)[2], 1.001 * impulse) << most;
      if (rig.sum_impulses(i)[2] > 0.98 * impulse) ++whole;
    }
    EXPECT_EQ(whole, first.impacts) << most;
    strike(1);  // as much again has become due
    EXPECT_EQ(rig.touches.get_counters().impacts, first.impacts + 1) << most;
    EXPECT_TRUE(rig.faults.empty());
  }
}

TEST(TouchEnergy, BlowsOnARingingPlateAddNoMoreThanTheirOwn) {
  const double e = 0.5, speed = 1.0;
  for (const double thickness : {0.5e-3, 2e-3}) {
    const bank::Bank plate = physics::tests::make_plate_bank(0.2, thickness, 8000.0, 8, 1e-6);
    Rig rig({.ground_restitution = e});
    rig.add(plate, "plate", {0, 0, 0.5 * thickness}, {}, e);
    rig.start();
    for (int blows = 1; blows <= 4; ++blows) {
      strike_both_ends(rig, plate, speed, e);
      const double lost_j = 0.5 * plate.rigid.mass_kg * speed * speed * (1.0 - e * e);
      EXPECT_LE(calc_modal_j(rig, plate, 0), 1.01 * blows * lost_j) << thickness << " m, after " << blows;
    }
    EXPECT_GT(rig.touches.get_counters().impacts, 0);
  }
}

/// Both corners of an edge strike within a step, the second up to 5 ms later: while the impact of the first lasts, and after it.
TEST(TouchEnergy, HitsOfAStepShareTheMotion) {
  const double thickness = 1e-3, e = 0.5;
  const bank::Bank plate = physics::tests::make_plate_bank(0.2, thickness, 8000.0, 8, 1.0);
  const double moved_kg = 0.25 * plate.rigid.mass_kg, lost_j = 0.5 * moved_kg * (1.0 - e * e);
  for (const bool early : {false, true}) {
    for (const double gap : {0.0, 1e-3, 5e-3}) {
      Rig rig({.early = early, .gravity_m_s2 = {}, .ground_restitution = e});
      rig.add(plate, "plate", {0, 0, 0.5 * thickness}, {0, 0, -0.25}, e);
      rig.poses[0].spin_rad_s[1] = 7.5;  // the motion that a blow on the edge gives: 1 m/s there
      rig.start();
      const double half = 0.5 * (1.0 + e) * moved_kg;
      std::vector<TouchPoint> points{on_ground(0, {0.1, -0.1, 0.0}, half), on_ground(0, {0.1, 0.1, 0.0}, half)};
      points[1].gap_m = gap;
      rig.poses[0].velocity_m_s[2] = 0.125;
      rig.poses[0].spin_rad_s[1] = -3.75;
      rig.step(1.0 / 60.0, points);
      rig.step(1.0 / 60.0, {});
      EXPECT_EQ(rig.touches.get_counters().hits, 2);
      EXPECT_GT(calc_modal_j(rig, plate, 0), 0.05 * lost_j) << early << " " << gap;
      EXPECT_LE(calc_modal_j(rig, plate, 0), 1.01 * lost_j) << early << " " << gap;
    }
  }
}

/// A blow on corners of a plate.
struct CornerBlow {
  double touch_s = 0.0, energy_j = 0.0, lost_j = 0.0;  // energy: of the motion along the contacts, all of it lost by e = 0
};

/// Gives a plate a random motion, and strikes in a step of `dt_s` corners that move down, all within that step. Without gravity.
CornerBlow strike_corners(Rig& rig, const bank::Bank& plate, double e, double dt_s, std::mt19937& chance) {
  const auto choose = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(chance); };
  const double mass = plate.rigid.mass_kg, along_x = plate.rigid.inertia_kg_m2[0], along_y = plate.rigid.inertia_kg_m2[4];
  TouchesPose& pose = rig.poses[0];
  pose.velocity_m_s = {0, 0, -choose(0.0, 1.0)};
  pose.spin_rad_s = {choose(-8.0, 8.0), choose(-8.0, 8.0), 0.0};
  rig.step(1e-6, {});
  const auto calc_speed = [&](const Vec3& corner) {
    return pose.velocity_m_s[2] + pose.spin_rad_s[0] * corner[1] - pose.spin_rad_s[1] * corner[0];
  };
  std::vector<TouchPoint> points;
  std::vector<double> speeds;
  for (const double x : {-0.1, 0.1})
    for (const double y : {-0.1, 0.1}) {
      const Vec3 corner{x, y, 0.0};
      const double speed = -calc_speed(corner);
      if (speed < 0.1 || chance() % 4 == 0) continue;
      points.push_back(on_ground(0, corner, 0.0));
      points.back().gap_m = chance() % 2 == 0 ? 0.0 : choose(0.0, 0.9) * dt_s * speed;
      speeds.push_back(speed);
    }
  const auto calc_motion_j = [&] {
    return 0.5 * (mass * pose.velocity_m_s[2] * pose.velocity_m_s[2] + along_x * pose.spin_rad_s[0] * pose.spin_rad_s[0] +
                  along_y * pose.spin_rad_s[1] * pose.spin_rad_s[1]);
  };
  CornerBlow blow{.touch_s = rig.time_s + dt_s, .lost_j = calc_motion_j()};
  for (int sweep = 0; sweep < 500; ++sweep)
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3& at = points[i].point_m;
      const double inverse = 1.0 / mass + at[1] * at[1] / along_x + at[0] * at[0] / along_y;
      const double push = std::max(-points[i].impulse_n_s, (e * speeds[i] - calc_speed(at)) / inverse);
      points[i].impulse_n_s += push;
      pose.velocity_m_s[2] += push / mass;
      pose.spin_rad_s[0] += push * at[1] / along_x;
      pose.spin_rad_s[1] -= push * at[0] / along_y;
    }
  blow.lost_j -= calc_motion_j();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].impulse_n_s > 0.0) blow.touch_s = std::min(blow.touch_s, rig.time_s + points[i].gap_m / speeds[i]);
    blow.energy_j += 0.5 * points[i].impulse_n_s * speeds[i] / (1.0 + e);
  }
  rig.step(dt_s, points);
  return blow;
}

TEST(TouchEnergy, NoInstantExceedsTheBlows) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 chance(seed);
    const double thickness = std::array{0.5e-3, 1e-3, 2e-3, 5e-3}[chance() % 4], e = std::array{0.0, 0.2, 0.5, 0.9}[chance() % 4];
    const bank::Bank plate = physics::tests::make_plate_bank(0.2, thickness, 8000.0, 8, 1e-6);
    const double dt_s = std::exp(std::uniform_real_distribution<double>(std::log(1e-4), std::log(1.0 / 30.0))(chance));
    Rig rig({.early = chance() % 2 == 0, .max_impacts = std::array{0, 1, 3, 8}[chance() % 4], .gravity_m_s2 = {}, .ground_restitution = e});
    rig.add(plate, "plate", {0, 0, 0.5 * thickness}, {}, e);
    rig.start();
    std::vector<CornerBlow> blows;
    for (unsigned n = 0; n <= seed % 5; ++n) {
      blows.push_back(strike_corners(rig, plate, e, dt_s, chance));
      for (unsigned wait = chance() % 3; wait > 0; --wait) rig.step(dt_s, {});
    }
    for (int n = 0; n < 20; ++n) rig.step(5e-3, {});
    const auto course = list_modal_j(rig, plate, 0);
    if (course.empty()) continue;
    double lost_j = 0.0, worst = 0.0;
    for (const CornerBlow& blow : blows) lost_j += std::max(blow.lost_j, 0.01 * blow.energy_j);
    for (const auto& [time_s, modal_j] : course) {
      double blows_j = 0.0;
      for (const CornerBlow& blow : blows) blows_j += blow.touch_s <= time_s + 1e-9 ? blow.energy_j : 0.0;
      worst = std::max(worst, modal_j / blows_j);
    }
    EXPECT_LE(worst, 1.01) << seed;
    EXPECT_LE(course.back().second, 1.01 * lost_j) << seed;
    EXPECT_TRUE(rig.faults.empty()) << seed;
  }
}

/// A slow hit on a thick plate is a Hertz pulse; on one that a fast one has left ringing, it is integrated.
TEST(TouchEnergy, SlowHitsOnARingingPlateAreIntegrated) {
  const double thickness = 20e-3;
  const bank::Bank plate = physics::tests::make_plate_bank(0.2, thickness, 8000.0, 8, 1.0);
  for (const double wait_s : {1e-3, 20.0}) {  // until it is silent
    Rig rig({.max_impacts = 8, .ground_restitution = 0.5});
    rig.add(plate, "plate", {0, 0, 0.5 * thickness}, {}, 0.5);
    rig.start();
    const auto strike = [&](double speed, double after_s) {
      const double impulse = 1.5 * speed * plate.rigid.mass_kg;
      rig.poses[0].velocity_m_s[2] = -speed;
      rig.step(after_s, {});
      rig.poses[0].velocity_m_s[2] = 0.5 * speed;
      rig.step(1e-4, {on_ground(0, {0, 0, 0}, impulse)});
    };
    strike(1.0, 1e-4);
    ASSERT_EQ(rig.touches.get_counters().impacts, 0) << "modes take little of it";
    strike(0.02, wait_s);
    for (int n = 0; n < 300; ++n) rig.step(1e-4, {});
    EXPECT_EQ(rig.touches.get_counters().hits, 2);
    EXPECT_EQ(rig.touches.get_counters().impacts, wait_s < 1.0 ? 1 : 0);
  }
}

}  // namespace
}  // namespace carillon::drive::tests

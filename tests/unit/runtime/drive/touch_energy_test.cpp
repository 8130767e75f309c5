// Energy that hits give to modes: never above the loss of kinetic energy.
#include <gtest/gtest.h>

#include <utility>

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
      Rig rig({.early = early, .ground_restitution = e});
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

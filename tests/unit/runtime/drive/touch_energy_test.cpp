// Energy that hits give to modes: never above the loss of kinetic energy.
#include <gtest/gtest.h>

#include "tests/unit/runtime/drive/modal_energy.hpp"
#include "tests/unit/runtime/physics/plate_bank.hpp"

namespace carillon::drive::tests {
namespace {

TEST(TouchEnergy, PlatesNeverRingWithMoreThanTheBlow) {
  const double thickness = 1e-3;  // others, and other restitutions: tests/hard
  const bank::Bank plate = physics::tests::make_plate_bank(0.2, thickness, 8000.0, 8, 1.0);
  for (const int impacts : {8, 0}) {
    Rig rig({.max_impacts = impacts, .ground_restitution = 0.5});
    const auto [blow_j, impulse_n_s] = strike_plate(rig, plate, thickness, 0.5);
    ASSERT_TRUE(rig.has_hits());
    EXPECT_LE(calc_modal_j(rig, plate, 0), 0.76 * blow_j) << impacts;
    EXPECT_LE(rig.sum_impulses(0)[2], 1.01 * impulse_n_s);
    EXPECT_TRUE(rig.faults.empty());
    EXPECT_EQ(rig.touches.get_counters().impacts + rig.touches.get_counters().simplified, 1) << "modes matter";
  }
}

}  // namespace
}  // namespace carillon::drive::tests

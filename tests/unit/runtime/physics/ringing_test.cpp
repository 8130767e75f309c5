// Impacts with modes: balance of energy and momentum; ringing bodies still support others.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <string>

#include "tests/unit/runtime/physics/bodies.hpp"
#include "tests/unit/runtime/physics/plate_bank.hpp"

namespace carillon::physics::tests {
namespace {

TEST(Ringing, EqualAndOppositeForces) {
  // Two that ring meet in flight without spin about the line between them.
  const bank::Bank ball = add_modes(make_ball(0.03, 3), 20), box = add_modes(make_box({0.1, 0.08, 0.05}), 20);
  WorldSpec w;
  w.gravity_m_s2 = {0, 0, 0};
  w.bodies = {make_body("ball", ball, {0, 0, 0}, 0.6), make_body("box", box, {0.2, 0.01, 0.005}, 0.6)};
  w.bodies[1].velocity_m_s = {-2, 0, 0};
  const Outcome r = run_audited(w, 0.2);
  ASSERT_FALSE(r.forces.empty());
  EXPECT_EQ(r.impulses, 0);
  const Simulation paths = collect(r.events, {ball.rigid.centre_m, box.rigid.centre_m});
  Vec3 on[2] = {};
  for (const events::Force& f : r.forces) {
    for (int k = 0; k < f.count; ++k) {
      const auto& j = f.impulse_n_s[k];
      const Pose pose = pose_at(paths.poses[f.body], f.time_s + k * f.step_s);
      on[f.body] = on[f.body] + rotate(pose.rotation, {j[0], j[1], j[2]});
    }
  }
  const double size = norm(on[0]);
  EXPECT_GT(size, 0.1);
  // Each force is in a frame of the end of its small step; poses are known every 2 ms.
  EXPECT_LT(norm(on[0] + on[1]), 5e-3 * size);
  EXPECT_LT(norm(on[0] - ball.rigid.mass_kg * find_last(r, 0).velocity_m_s), 5e-3 * size);
  const Vec3 total = ball.rigid.mass_kg * find_last(r, 0).velocity_m_s + box.rigid.mass_kg * find_last(r, 1).velocity_m_s;
  EXPECT_LT(norm(total - box.rigid.mass_kg * Vec3{-2, 0, 0}), 1e-9 * box.rigid.mass_kg);
}

// Plates just above the floor that others strike down, by impacts with modes. Of the first 120 strikes eleven were deeper than 0.1 mm, one
// 4 mm, before bodies that an impact moves met all that they come to reach.
TEST(Ringing, StruckPlatesMeetTheFloorInTime) {
  std::mt19937 random(11);
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const bank::Bank large = make_plate_bank(0.1, 3e-3, 8000.0, 8, 20.0), small = make_plate_bank(0.04, 2e-3, 20000.0, 8, 20.0);
  for (int n = 0; n < 240; ++n) {
    WorldSpec w;
    w.ground = GroundSpec{};
    double low_m = draw(2e-4, 1.5e-3), kinetic_j = 0.0;
    for (const bank::Bank* bank : {n % 2 == 0 ? &small : &large, &large}) {
      BodySpec& body = w.bodies.emplace_back(make_body("plate " + std::to_string(w.bodies.size()), *bank, {}, draw(0.1, 0.8)));
      const double half = 0.5 * draw(-0.3, 0.3), axis = draw(0.0, M_PI);
      body.initial.rotation = {std::cos(half), std::sin(half) * std::cos(axis), std::sin(half) * std::sin(axis), 0};
      double lowest_m = 1.0, highest_m = -1.0;
      for (const auto& x : bank->vertices_m) {
        const double z = rotate(body.initial.rotation, {x[0], x[1], x[2]})[2];
        lowest_m = std::min(lowest_m, z);
        highest_m = std::max(highest_m, z);
      }
      body.initial.position_m = {draw(-0.01, 0.01), draw(-0.01, 0.01), low_m - lowest_m};
      low_m += highest_m - lowest_m + draw(1e-4, 3e-3);
      if (w.bodies.size() == 1) continue;
      body.velocity_m_s = {0, 0, draw(-3.0, -1.0)};
      kinetic_j = 0.5 * bank->rigid.mass_kg * body.velocity_m_s[2] * body.velocity_m_s[2];
    }
    World world(w, {.end_s = 0.03, .lasting_contacts = false, .audits_energy = true});
    world.advance(0.03, std::numeric_limits<double>::infinity(), [](const events::Event&) {});
    const Statistics statistics = world.get_statistics();
    EXPECT_LT(statistics.contacts.unexplained.unexplained_m, 1e-4) << n;
    EXPECT_LT(statistics.energy.error_j, 0.01 * kinetic_j) << n;
  }
}

class Books : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Scenes, Books, testing::Range(0, 10));

TEST_P(Books, EnergyBalanceWithinOnePercent) {
  const bank::Bank ball = add_modes(make_ball(0.03, 3), 20), box = add_modes(make_box({0.1, 0.08, 0.05}), 20),
                   plate = add_modes(make_box({0.4, 0.3, 0.01}), 20), lump = add_modes(make_eared_ball(0.05, 3), 20);
  WorldSpec w;
  w.ground = GroundSpec{};
  switch (GetParam()) {
    case 0:
      w.bodies = {make_body("ball", ball, {0, 0, 0.5}, 0.6)};
      break;
    case 1:
      w.bodies = {make_body("box", box, {0, 0, 0.3}, 0.6)};
      w.bodies[0].initial.rotation = {0.9, 0.3, -0.2, 0.4};
      break;
    case 2:
      w.bodies = {make_body("plate", plate, {0, 0, 0.3}, 0.6)};
      w.bodies[0].initial.rotation = {0.95, 0.2, 0.1, 0.0};
      break;
    case 3:
      w.bodies = {make_body("lump", lump, {0, 0, 0.3}, 0.6)};
      w.bodies[0].angular_velocity_rad_s = {5, -3, 2};
      break;
    case 4:  // lies on the ground and is struck
      w.bodies = {make_body("plate", plate, {0, 0, 0.005}, 0.6), make_body("ball", ball, {0.05, 0.08, 0.4}, 0.6)};
      break;
    case 5:  // the same, far from its middle
      w.bodies = {make_body("plate", plate, {0, 0, 0.005}, 0.6), make_body("ball", ball, {0.17, 0.12, 0.4}, 0.6)};
      break;
    case 6:  // a box that falls on one that stands
      w.bodies = {make_body("box", box, {0, 0, 0.025}, 0.6), make_body("other", box, {0.02, 0.01, 0.3}, 0.6)};
      w.bodies[1].initial.rotation = {0.98, 0.1, 0.15, 0.0};
      break;
    case 7:  // a ball on a plate on a box
      w.bodies = {make_body("box", box, {0, 0, 0.025}, 0.6), make_body("plate", plate, {0, 0, 0.055}, 0.6),
                  make_body("ball", ball, {0.01, 0.01, 0.4}, 0.6)};
      break;
    case 8:  // the struck body lies on a ringing shelf
      w.bodies = {make_body("shelf", plate, {0, 0, 0.3}, 0.6), make_body("box", box, {0.05, 0.02, 0.33}, 0.6),
                  make_body("ball", ball, {0.06, 0.03, 0.6}, 0.6)};
      w.bodies[0].fixed = true;
      break;
    default:
      w.bodies = {make_body("shelf", plate, {0, 0, 0.3}, 0.6), make_body("box", box, {0.02, 0, 0.5}, 0.6),
                  make_body("ball", ball, {0, 0.05, 0.8}, 0.6)};
      w.bodies[0].fixed = true;
      w.bodies[0].initial.rotation = {std::cos(0.15), 0, std::sin(0.15), 0};
  }
  const EnergyAudit e = run_audited(w, 1.0).energy;
  EXPECT_GT(e.max_modes_j, 0.0);
  EXPECT_GT(e.lost_j, 0.0);
  EXPECT_LT(e.error_j, 0.01 * e.start_j) << "start " << e.start_j << ", motion " << e.motion_j << ", modes " << e.modes_j << ", lost "
                                         << e.lost_j;
  // The modes never have more than the fall had.
  EXPECT_LT(e.max_modes_j, e.start_j);
}

TEST(Ringing, BoxesThatStrikeTheGroundAndEachOtherAtOnceKeepTheBooks) {
  // Each may be in an impact of its own when they meet: a body is in one at a time.
  const bank::Bank box = add_modes(make_box({0.1, 0.08, 0.05}), 20);
  for (int n = 0; n < 60; ++n) {
    SCOPED_TRACE(n);
    WorldSpec w;
    w.ground = GroundSpec{};
    w.bodies = {make_body("box", box, {0, 0, 0.025}, 0.6), make_body("other", box, {0.02 + 3e-4 * n, 0.01, 0.15}, 0.6),
                make_body("third", box, {-0.02, 2e-4 * n, 0.3}, 0.6)};
    w.bodies[1].initial.rotation = {0.98, 0.1, 0.15, 0.0};
    w.bodies[2].initial.rotation = {0.9, -0.3, 0.1, 0.2};
    const EnergyAudit e = run_audited(w, 0.7).energy;
    EXPECT_LT(e.error_j, 0.01 * e.start_j);
    EXPECT_LT(e.max_modes_j, e.start_j);
  }
}

TEST(Ringing, EnergyBalanceOfRandomHeaps) {
  // Random heaps: boxes, plates and balls that ring, on the ground or on a shelf that rings, of all restitutions.
  const bank::Bank banks[] = {add_modes(make_ball(0.03, 3), 20), add_modes(make_box({0.1, 0.08, 0.05}), 20),
                              add_modes(make_box({0.2, 0.15, 0.01}), 20), add_modes(make_eared_ball(0.05, 3), 20),
                              make_box({0.06, 0.06, 0.06})};
  const bank::Bank shelf = add_modes(make_box({0.6, 0.5, 0.02}), 20);
  const char* given = std::getenv("CARILLON_HEAPS");  // more of them by hand
  const int heaps = given != nullptr ? std::atoi(given) : 12;
  ASSERT_GT(heaps, 0);
  for (int n = 0; n < heaps; ++n) {
    SCOPED_TRACE(n);
    std::mt19937 random(static_cast<unsigned>(n));
    const auto draw = [&](double low, double high) { return low + (high - low) * (random() / 4294967296.0); };
    WorldSpec w;
    w.ground = GroundSpec{};
    w.ground->restitution = draw(0.0, 1.0);
    const bool has_shelf = draw(0, 1) < 0.4;
    if (has_shelf) {
      w.bodies.push_back(make_body("shelf", shelf, {0, 0, 0.3}, draw(0.0, 1.0)));
      w.bodies.back().fixed = true;
    }
    const int count = 2 + static_cast<int>(draw(0, 4));
    for (int k = 0; k < count; ++k) {
      const std::size_t kind = draw(0, 5);
      // One after the other: the order of arguments is the compiler's.
      double numbers[12];
      for (double& x : numbers) x = draw(-1.0, 1.0);
      const double restitution = draw(0.0, 1.0);
      const Vec3 place{0.05 * numbers[0], 0.05 * numbers[1], (has_shelf ? 0.45 : 0.15) + 0.25 * k};
      w.bodies.push_back(make_body("body", banks[kind], place, restitution));
      BodySpec& body = w.bodies.back();
      body.name += std::to_string(k);
      body.friction = draw(0.0, 1.0);
      body.initial.rotation = {numbers[2], numbers[3], numbers[4], numbers[5]};
      body.velocity_m_s = {0.3 * numbers[6], 0.3 * numbers[7], numbers[8] - 1.0};
      body.angular_velocity_rad_s = {5.0 * numbers[9], 5.0 * numbers[10], 5.0 * numbers[11]};
    }
    const EnergyAudit e = run_audited(w, 1.0).energy;
    EXPECT_LT(e.error_j, 0.01 * e.start_j);
    EXPECT_LT(e.max_modes_j, e.start_j);
    EXPECT_LE(e.modes_share, 1.0);
  }
}

TEST(Ringing, EnergyOfTurningBodiesThatMeetInFlight) {
  // The gyroscopic couple does no work, nor does the change of the inertia as a body turns.
  const bank::Bank plate = add_modes(make_box({0.4, 0.3, 0.01}), 20), box = add_modes(make_box({0.1, 0.08, 0.05}), 20);
  std::mt19937 random(5);
  const auto draw = [&](double most) { return std::uniform_real_distribution<double>(-most, most)(random); };
  for (int pair = 0; pair < 20; ++pair) {
    WorldSpec w;
    w.gravity_m_s2 = {0, 0, 0};
    w.bodies = {make_body("plate", plate, {0, 0, 0}, 0.6), make_body("box", box, {0.05, 0.02, 0.2}, 0.6)};
    for (const int body : {0, 1})
      for (double& spin : w.bodies[body].angular_velocity_rad_s) spin = draw(body == 0 ? 6.0 : 20.0);
    w.bodies[1].velocity_m_s = {0, 0, -2};
    const EnergyAudit e = run_audited(w, 0.5).energy;
    EXPECT_GT(e.max_modes_j, 0.0);
    EXPECT_LT(e.error_j, 1e-7 * e.start_j);
  }
}

TEST(Ringing, GroundReactionOfStruckPlate) {
  // A ball falls on a plate that lies on the ground, and the plate sounds by the blow and by the ground. Of all that acts on it gravity is
  // the one that is not sounded.
  const bank::Bank ball = add_modes(make_ball(0.03, 3), 20), plate = add_modes(make_box({0.4, 0.3, 0.01}), 20);
  WorldSpec w;
  w.ground = GroundSpec{};
  w.bodies = {make_body("plate", plate, {0, 0, 0.005}, 0.6), make_body("ball", ball, {0.03, 0.04, 0.1}, 0.6)};
  const Outcome r = run_audited(w, 0.13);
  double on_ball = 0.0, on_plate = 0.0, by_ball = 0.0;
  for (const events::Force& f : r.forces)
    for (int k = 0; k < f.count; ++k) {
      const double up = f.impulse_n_s[k][2];
      if (f.body == 1) on_ball += up;
      if (f.body == 0) (f.other == 1 ? by_ball : on_plate) += up;
    }
  const double fall = std::sqrt(2.0 * 9.81 * 0.06);
  EXPECT_GT(on_ball, 0.5 * ball.rigid.mass_kg * fall);
  EXPECT_NEAR(by_ball, -on_ball, 0.01 * on_ball);
  // The ground took the momentum of the ball.
  EXPECT_GT(on_plate, 0.3 * on_ball);
  EXPECT_GT(r.energy.max_modes_j, 0.02 * ball.rigid.mass_kg * 9.81 * 0.06);
  EXPECT_LT(r.energy.error_j, 0.01 * ball.rigid.mass_kg * 9.81 * 0.06);
}

TEST(Ringing, SupportByStruckShelf) {
  // Balls strike a shelf that rings while a box lies at its other end.
  const bank::Bank ball = add_modes(make_ball(0.03, 3), 20), box = add_modes(make_box({0.1, 0.08, 0.05}), 20),
                   plate = add_modes(make_box({0.6, 0.3, 0.01}), 20);
  WorldSpec w;
  w.bodies = {make_body("shelf", plate, {0, 0, 0}, 0.6), make_body("box", box, {-0.2, 0, 0.03}, 0.6),
              make_body("ball", ball, {0.2, 0, 0.3}, 0.6), make_body("other", ball, {0.2, 0.1, 0.3003}, 0.6)};
  w.bodies[0].fixed = true;
  const Outcome r = run_audited(w, 0.6);
  int on_shelf = 0;
  for (const events::Force& f : r.forces) on_shelf += f.body == 0 ? 1 : 0;
  EXPECT_GT(on_shelf, 0);
  EXPECT_NEAR(find_last(r, 1).position_m[2], 0.03, 1e-6);
  EXPECT_LT(r.energy.error_j, 0.01 * std::abs(r.energy.start_j));
}

}  // namespace
}  // namespace carillon::physics::tests

// A body that rests is struck together with its supports.
#include <gtest/gtest.h>

#include "tests/unit/runtime/drive/modal_energy.hpp"
#include "tests/unit/runtime/physics/plate_bank.hpp"

namespace carillon::drive::tests {
namespace {

constexpr double kThickness = 2e-3, kHalf = 0.1, kStep = 1e-3, kSpeed = 1.0, kMass = 0.02;

/// A plate on its four corners, and a ball of steel above its middle that strikes it after 0.1 s, if `gap_m` is 0. The engine's plate is
/// rigid: the ground has all of the blow in the same step, as pushes of points that did not close, or closed at `sinks_m_s`. 0.15 s follow.
void strike_resting_plate(Rig& rig, const bank::Bank& plate, bool is_supported, double sinks_m_s = 0.0) {
  rig.add(plate, "plate", {0, 0, 0.5 * kThickness});
  const int ball = rig.touches.add(
      {.body = -1, .name_hash = 7, .mass_kg = kMass, .young_pa = 2e11, .poisson = 0.3, .density_kg_m3 = 7800.0, .size_m = 0.02});
  rig.poses.push_back({.position_m = {0, 0, kThickness + 0.01}, .velocity_m_s = {0, 0, -kSpeed}});
  rig.start();
  const double weight = plate.rigid.mass_kg * kGravity * kStep, blow = 1.5 * kSpeed * kMass;
  const Vec3 half{kHalf, kHalf, 0.0};
  const auto carry = [&](double impulse) { return is_supported ? on_four_corners(0, {}, half, impulse) : std::vector<TouchPoint>{}; };
  for (int n = 0; n < 100; ++n) {
    if (n == 99) rig.poses[0].velocity_m_s[2] = -sinks_m_s;
    rig.step(kStep, carry(weight));
  }
  ASSERT_FALSE(rig.has_hits());
  std::vector<TouchPoint> points = carry(weight + blow);
  rig.poses[0].velocity_m_s = {};
  points.push_back({.a = ball, .b = 0, .point_m = {0, 0, kThickness}, .normal = {0, 0, 1}, .impulse_n_s = blow, .friction_n_s = {0, 0, 0}});
  rig.poses[1].velocity_m_s[2] = 0.5 * kSpeed;
  rig.step(kStep, points);
  for (int n = 0; n < 150; ++n) rig.step(kStep, carry(weight));
  EXPECT_TRUE(rig.faults.empty());
}

/// Impulse of the upward forces on the plate at each place [N s]; those of the ball push down.
std::map<std::int32_t, double> sum_upwards(const Rig& rig) {
  std::map<std::int32_t, double> sums;
  for (const auto& force : rig.list<events::Force>())
    if (const double push = events::calc_impulse(force)[2]; push > 0.0) sums[force.triangle] += push;
  return sums;
}

class StruckPlate : public testing::TestWithParam<double> {};

TEST_P(StruckPlate, IsPushedByTheGroundAtItsCorners) {
  const bank::Bank plate = physics::tests::make_plate_bank(2.0 * kHalf, kThickness, 8000.0, 8, 1.0);
  Rig rig;
  strike_resting_plate(rig, plate, true, GetParam());
  EXPECT_TRUE(rig.list<events::Impulse>().empty()) << "pushes that pass on the blow are in its impact";
  EXPECT_EQ(rig.touches.get_counters().impacts, 1);
  const std::map<std::int32_t, double> corners = sum_upwards(rig);
  ASSERT_EQ(corners.size(), 4U);
  const double first = corners.begin()->second;
  EXPECT_GT(first, 0.0);
  for (const auto& [place, push] : corners) EXPECT_NEAR(push, first, 0.05 * first) << "the plate is symmetrical";
  const auto forces = rig.list<events::Force>();
  const auto by_ball = std::find_if(forces.begin(), forces.end(), [](const auto& f) { return events::calc_impulse(f)[2] < 0.0; });
  ASSERT_NE(by_ball, forces.end());
  for (const auto& force : forces) EXPECT_GE(force.time_s, by_ball->time_s);
  EXPECT_LE(calc_modal_j(rig, plate, 0), 0.76 * 0.5 * kMass * kSpeed * kSpeed);
}

INSTANTIATE_TEST_SUITE_P(SinkingAtTheBlow, StruckPlate, testing::Values(0.0, 0.02));

/// While a plate rattles its supports damp no modes; their contacts last. They damp again when it has decayed.
TEST(TouchSupports, RattlingContactsDampNothing) {
  for (const double decay_per_s : {1.0, 100.0}) {
    const bank::Bank plate = physics::tests::make_plate_bank(2.0 * kHalf, kThickness, 8000.0, 8, decay_per_s);
    Rig rig;
    strike_resting_plate(rig, plate, true);
    const double struck_s = 0.1, rattle_s = decay_per_s > 10.0 ? 0.02 : 0.1;
    int rattling = 0, begun = 0, ended = 0;
    for (const auto& contact : rig.list<events::LastingContact>()) {
      begun += contact.state == events::ContactState::kBegin;
      ended += contact.state == events::ContactState::kEnd;
      const double since_s = contact.time_s - struck_s;
      if (since_s < 0.0 || since_s > rattle_s + 0.01) {
        EXPECT_GT(contact.impedance_n_s_m, 0.0) << since_s;
      } else if (since_s > 2e-3 && since_s < 0.5 * rattle_s) {
        EXPECT_EQ(contact.impedance_n_s_m, 0.0) << since_s;
        ++rattling;
      }
    }
    EXPECT_GT(rattling, 4);
    EXPECT_EQ(begun, 4);
    EXPECT_EQ(ended, 0);
  }
}

TEST(TouchSupports, PlateInTheAirHasNone) {
  const bank::Bank plate = physics::tests::make_plate_bank(2.0 * kHalf, kThickness, 8000.0, 8, 1.0);
  Rig rig;
  strike_resting_plate(rig, plate, false);
  EXPECT_EQ(rig.touches.get_counters().impacts, 1);
  EXPECT_FALSE(rig.list<events::Force>().empty());
  EXPECT_TRUE(sum_upwards(rig).empty());
}

/// A push that is passed on by rigid bodies has the time of the hit that caused it, which is inside a long step.
TEST(TouchSupports, PassedOnPushesBeginWithTheirHit) {
  const bank::Bank ball = physics::tests::make_ball(0.02, 4);
  Rig rig;
  rig.add(ball, "lower", {0, 0, 0.02});
  const double dt = 1.0 / 60.0, gap = 4e-3, speed = 1.0, blow = 1.5 * speed * ball.rigid.mass_kg;
  rig.add(ball, "upper", {0, 0, 0.06 + gap}, {0, 0, -speed});
  rig.start();
  const double weight = ball.rigid.mass_kg * kGravity * dt;
  rig.poses[1].velocity_m_s = {};
  std::vector<TouchPoint> points{on_ground(0, {0, 0, 0}, weight + blow)};
  points.push_back(
      {.a = 1, .b = 0, .point_m = {0, 0, 0.04}, .normal = {0, 0, 1}, .gap_m = gap, .impulse_n_s = blow, .friction_n_s = {0, 0, 0}});
  rig.step(dt, points);
  for (int n = 0; n < 3; ++n) rig.step(dt, {on_ground(0, {0, 0, 0}, weight)});
  const auto pulses = rig.list<events::Impulse>();
  ASSERT_EQ(pulses.size(), 3U);
  for (const auto& pulse : pulses) EXPECT_NEAR(pulse.time_s - 0.5 * pulse.duration_s, gap / speed, 0.1 * gap / speed);
}

}  // namespace
}  // namespace carillon::drive::tests

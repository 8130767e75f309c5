#include "runtime/events/events.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <type_traits>
#include <vector>

namespace carillon::events::tests {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

LastingContact make_contact() {
  LastingContact contact;
  contact.normal = {0.0, 0.6, 0.8};
  contact.force_n = 2.0;
  contact.patch_radius_m = 1e-4;
  return contact;
}

std::string find(const Event& event) {
  const char* const fault = find_fault(event);
  return fault == nullptr ? "" : fault;
}

/// Fault of a valid event after `spoil` changed one member.
template <class T, class Spoil>
std::string spoil(T event, Spoil change) {
  EXPECT_EQ(find(event), "");
  change(event);
  return find(event);
}

Force make_force(int count = 3) {
  Force force{.step_s = 1e-5, .count = static_cast<std::int16_t>(count)};
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) force.impulse_n_s[k] = {0.0F, -1e-4F, 1e-3F};
  return force;
}

TEST(Force, WithAFaultIsFound) {
  EXPECT_EQ(find(make_force()), "");
  EXPECT_EQ(find(make_force(kMaxForceSteps)), "");
  const auto change = [](auto&& work) { return spoil(make_force(), work); };
  EXPECT_EQ(change([](Force& e) { e.count = 0; }), "the number of steps is not 1 to 16");
  EXPECT_EQ(change([](Force& e) { e.count = kMaxForceSteps + 1; }), "the number of steps is not 1 to 16");
  for (const double bad : {kNan, kInfinity, 0.0, -1e-5})
    EXPECT_EQ(change([&](Force& e) { e.step_s = bad; }), "the length of a step is not above 0");
  for (const double bad : {kNan, kInfinity}) {
    EXPECT_EQ(change([&](Force& e) { e.impulse_n_s[2][1] = static_cast<float>(bad); }), "an impulse is not finite");
    EXPECT_EQ(change([&](Force& e) { e.time_s = bad; }), "the time is not finite");
  }
  EXPECT_EQ(change([](Force& e) { e.impulse_n_s[3][0] = static_cast<float>(kNan); }), "") << "values beyond the count are ignored";
  EXPECT_EQ(change([](Force& e) { e.triangle = -1; }), "the index of the triangle is negative");
}

TEST(Force, IsSplitIntoConsecutivePieces) {
  for (const std::size_t steps : {1U, 16U, 17U, 1300U}) {
    std::vector<Vec3> impulses;
    for (std::size_t k = 0; k < steps; ++k) impulses.push_back({1e-6 * static_cast<double>(k), -0.5, 0.25});
    std::vector<Force> pieces;
    split_force({.time_s = 0.5, .step_s = 1e-5, .triangle = 4}, impulses, [&](const Force& piece) { pieces.push_back(piece); });
    ASSERT_EQ(pieces.size(), (steps + 15) / 16);
    Vec3 sum{};
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      EXPECT_EQ(find(pieces[i]), "");
      EXPECT_EQ(pieces[i].continues, i > 0);
      EXPECT_EQ(pieces[i].triangle, 4);
      EXPECT_NEAR(pieces[i].time_s, 0.5 + 16e-5 * static_cast<double>(i), 1e-15);
      const Vec3 own = calc_impulse(pieces[i]);
      for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += own[axis];
    }
    const auto n = static_cast<double>(steps);
    EXPECT_NEAR(sum[0], 1e-6 * n * (n - 1.0) / 2.0, 1e-7 * (1.0 + sum[0]));
    EXPECT_EQ(sum[1], -0.5 * n);
  }
}

TEST(Force, AsImpulseActsAtItsCentroid) {
  Force force = make_force(4);
  force.time_s = 1.0;
  force.impulse_n_s[3] = {};
  const Impulse impulse = to_impulse(force);
  EXPECT_NEAR(impulse.time_s, 1.0 + 1.5e-5, 1e-15);
  EXPECT_NEAR(impulse.impulse_n_s[2], 3e-3, 1e-9);
  EXPECT_EQ(impulse.duration_s, 0.0);
}

TEST(Events, CanBeCopiedByteByByte) {
  EXPECT_LE(sizeof(Event), 256U) << "every queue holds them";
  EXPECT_TRUE(std::is_trivially_copyable_v<Event>);
  EXPECT_TRUE(std::is_nothrow_copy_constructible_v<Event>);
}

TEST(Events, HaveATime) {
  Impulse impulse;
  impulse.time_s = 0.25;
  BodyMotion motion;
  motion.time_s = 3.5;
  EXPECT_EQ(get_time_s(impulse), 0.25);
  EXPECT_EQ(get_time_s(motion), 3.5);
  EXPECT_EQ(get_time_s(TimeWatermark{-1.0}), -1.0);
}

TEST(Events, ValidHaveNoFault) {
  EXPECT_EQ(find(TimeWatermark{1.0}), "");
  EXPECT_EQ(find(Impulse{}), "");
  EXPECT_EQ(find(make_contact()), "");
  EXPECT_EQ(find(BodyMotion{}), "");
  EXPECT_EQ(find(Listener{}), "");
}

TEST(Events, WithNonFiniteTimeAreFound) {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    EXPECT_EQ(find(TimeWatermark{bad}), "the time is not finite");
    EXPECT_EQ(spoil(Impulse{}, [&](Impulse& e) { e.time_s = bad; }), "the time is not finite");
    EXPECT_EQ(spoil(Listener{}, [&](Listener& e) { e.time_s = bad; }), "the time is not finite");
  }
}

TEST(Events, ImpulsesAreChecked) {
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.body = -1; }), "the index of the body is negative");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.other = -2; }), "the index of the other body is below -1");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.triangle = -1; }), "the index of the triangle is negative");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.barycentric = {1.1, -0.1, 0.0}; }), "a barycentric coordinate is outside 0..1");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.barycentric = {kNan, 0.5, 0.5}; }), "a barycentric coordinate is outside 0..1");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.barycentric = {0.5, 0.5, 0.5}; }), "the barycentric coordinates do not sum to 1");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.barycentric = {1.0 + 1e-7, -1e-7, 0.0}; }), "");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.shape = static_cast<PulseShape>(7); }), "the shape of the pulse is unknown");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.impulse_n_s[2] = kNan; }), "the impulse is not finite");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.duration_s = -1e-9; }), "the duration is negative or not finite");
  EXPECT_EQ(spoil(Impulse{}, [](Impulse& e) { e.duration_s = kInfinity; }), "the duration is negative or not finite");
}

TEST(Events, ContactsAreChecked) {
  const LastingContact right = make_contact();
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.body = -5; }), "the index of the body is negative");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.state = static_cast<ContactState>(3); }), "the state of the contact is unknown");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.normal = {0.0, 0.0, 0.9}; }), "the normal is not a unit vector");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.normal = {kNan, 0.0, 1.0}; }), "the normal is not a unit vector");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.slip_m_s = {0.0, kInfinity, 0.0}; }), "the slip is not finite");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.force_n = -1.0; }), "the force is negative or not finite");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.sweep_m_s = -1.0; }), "a sweep is negative or not finite");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.other_sweep_m_s = kNan; }), "a sweep is negative or not finite");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.spin_rad_s = kNan; }), "the spin is negative or not finite");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.patch_radius_m = 0.0; }), "the radius of the patch is not above 0");
  EXPECT_EQ(spoil(right, [](LastingContact& e) { e.impedance_n_s_m = -2.0; }), "the impedance is negative or not finite");
}

TEST(Events, MotionsAndListenersAreChecked) {
  EXPECT_EQ(spoil(BodyMotion{}, [](BodyMotion& e) { e.body = -1; }), "the index of the body is negative");
  EXPECT_EQ(spoil(BodyMotion{}, [](BodyMotion& e) { e.position_m[0] = kNan; }), "the position is not finite");
  EXPECT_EQ(spoil(BodyMotion{}, [](BodyMotion& e) { e.velocity_m_s[1] = kInfinity; }), "the velocity is not finite");
  EXPECT_EQ(spoil(BodyMotion{}, [](BodyMotion& e) { e.rotation = {0.0, 0.0, 0.0, 0.0}; }), "the rotation is not a unit quaternion");
  EXPECT_EQ(spoil(BodyMotion{}, [](BodyMotion& e) { e.rotation = {0.6, 0.0, 0.8005, 0.0}; }), "");
  EXPECT_EQ(spoil(Listener{}, [](Listener& e) { e.rotation[3] = kNan; }), "the rotation is not a unit quaternion");
  EXPECT_EQ(spoil(Listener{}, [](Listener& e) { e.velocity_m_s[2] = kNan; }), "the velocity is not finite");
}

}  // namespace
}  // namespace carillon::events::tests

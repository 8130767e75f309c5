#include "runtime/stream/events.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <type_traits>

namespace carillon::stream::tests {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Contact make_contact() {
  Contact contact;
  contact.normal = {0.0, 0.6, 0.8};
  contact.force_n = 2.0;
  contact.patch_radius_m = 1e-4;
  return contact;
}

std::string find(const Event& event) {
  const char* const fault = find_fault(event);
  return fault == nullptr ? "" : fault;
}

/// Spoils one member of an event that is right, and asks what is wrong.
template <class T, class Spoil>
std::string spoil(T event, Spoil change) {
  EXPECT_EQ(find(event), "");
  change(event);
  return find(event);
}

TEST(Events, CanBeCopiedByteByByte) {
  EXPECT_TRUE(std::is_trivially_copyable_v<Event>);
  EXPECT_TRUE(std::is_nothrow_copy_constructible_v<Event>);
}

TEST(Events, TellTheirTime) {
  Impulse impulse;
  impulse.time_s = 0.25;
  Motion motion;
  motion.time_s = 3.5;
  EXPECT_EQ(get_time_s(impulse), 0.25);
  EXPECT_EQ(get_time_s(motion), 3.5);
  EXPECT_EQ(get_time_s(Mark{-1.0}), -1.0);
}

TEST(Events, ThatAreRightHaveNoFault) {
  EXPECT_EQ(find(Mark{1.0}), "");
  EXPECT_EQ(find(Impulse{}), "");
  EXPECT_EQ(find(make_contact()), "");
  EXPECT_EQ(find(Motion{}), "");
  EXPECT_EQ(find(Listener{}), "");
}

TEST(Events, WithATimeThatIsNoNumberAreFound) {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    EXPECT_EQ(find(Mark{bad}), "the time is not finite");
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
  const Contact right = make_contact();
  EXPECT_EQ(spoil(right, [](Contact& e) { e.body = -5; }), "the index of the body is negative");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.state = static_cast<ContactState>(3); }), "the state of the contact is unknown");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.normal = {0.0, 0.0, 0.9}; }), "the normal is not a unit vector");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.normal = {kNan, 0.0, 1.0}; }), "the normal is not a unit vector");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.slip_m_s = {0.0, kInfinity, 0.0}; }), "the slip is not finite");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.force_n = -1.0; }), "the force is negative or not finite");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.sweep_m_s = -1.0; }), "a sweep is negative or not finite");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.other_sweep_m_s = kNan; }), "a sweep is negative or not finite");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.spin_rad_s = kNan; }), "the spin is negative or not finite");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.patch_radius_m = 0.0; }), "the radius of the patch is not above 0");
  EXPECT_EQ(spoil(right, [](Contact& e) { e.impedance_n_s_m = -1.0; }), "the impedance is negative or not finite");
}

TEST(Events, MotionsAndListenersAreChecked) {
  EXPECT_EQ(spoil(Motion{}, [](Motion& e) { e.body = -1; }), "the index of the body is negative");
  EXPECT_EQ(spoil(Motion{}, [](Motion& e) { e.position_m[0] = kNan; }), "the position is not finite");
  EXPECT_EQ(spoil(Motion{}, [](Motion& e) { e.velocity_m_s[1] = kInfinity; }), "the velocity is not finite");
  EXPECT_EQ(spoil(Motion{}, [](Motion& e) { e.rotation = {0.0, 0.0, 0.0, 0.0}; }), "the rotation is not a unit quaternion");
  EXPECT_EQ(spoil(Motion{}, [](Motion& e) { e.rotation = {0.6, 0.0, 0.8005, 0.0}; }), "");
  EXPECT_EQ(spoil(Listener{}, [](Listener& e) { e.rotation[3] = kNan; }), "the rotation is not a unit quaternion");
  EXPECT_EQ(spoil(Listener{}, [](Listener& e) { e.velocity_m_s[2] = kNan; }), "the velocity is not finite");
}

}  // namespace
}  // namespace carillon::stream::tests

// Mechanisms alone: free motion and response to impulses, against closed forms and independent equations.
#include "runtime/physics/joints/mechanism.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <stdexcept>

namespace carillon::joints {
namespace {

constexpr double kG = 9.81;
constexpr double kFine = 1e-10;  // a tolerance for comparisons to many digits
constexpr Vec3 kGravity{0, 0, -kG};

/// A thin bar of length `l` whose centre hangs at the angle `a` from the vertical, in the plane y = 0, `below` its upper end.
Member make_bar(double mass, double l, const Vec3& top, double a, double spin = 0.0) {
  Member m;
  m.mass_kg = mass;
  const double i = mass * l * l / 12.0;
  m.inertia_kg_m2 = {Vec3{i, 0, 0}, Vec3{0, i, 0}, Vec3{0, 0, 1e-4 * i}};
  const Vec3 along{std::sin(a), 0, -std::cos(a)};
  m.start.centre = top + (0.5 * l) * along;
  m.start.rotation = {std::cos(-0.5 * a), 0, std::sin(-0.5 * a), 0};  // about -y
  m.start.spin = {0, -spin, 0};
  m.start.velocity = cross(m.start.spin, 0.5 * l * along);
  return m;
}

Joint make_hinge(int body, int to, const Vec3& at) { return {.kind = Kind::kHinge, .body = body, .to = to, .at = at, .axis = {0, 1, 0}}; }

double calc_energy(const std::vector<Member>& members, const std::vector<Motion>& motions) {
  double sum = 0.0;
  for (std::size_t i = 0; i < members.size(); ++i) {
    const auto& q = motions[i].rotation;
    // Spin in the axes of the body: by the inverse rotation.
    const Vec3 u{-q[1], -q[2], -q[3]}, w = motions[i].spin, t = 2.0 * cross(u, w);
    const Vec3 spin = w + q[0] * t + cross(u, t);
    sum += 0.5 * members[i].mass_kg * dot(motions[i].velocity, motions[i].velocity) + 0.5 * dot(spin, members[i].inertia_kg_m2 * spin) -
           members[i].mass_kg * dot(kGravity, motions[i].centre);
  }
  return sum;
}

/// Period of a pendulum of the angular frequency w0 that swings to `a`: 2 pi / (w0 agm(1, cos a/2)).
double calc_period(double w0, double a) {
  double x = 1.0, y = std::cos(0.5 * a);
  while (std::abs(x - y) > 1e-15) {
    const double mean = 0.5 * (x + y);
    y = std::sqrt(x * y);
    x = mean;
  }
  return 2.0 * std::numbers::pi / (w0 * x);
}

TEST(mechanism, pendulum_period) {
  for (const double a : {0.01, 0.5, 1.5, 3.0}) {
    const double l = 0.6;
    const std::vector<Member> members{make_bar(0.4, l, {}, a)};
    const auto m = make_mechanism(members, {make_hinge(0, -1, {})}, kGravity);
    ASSERT_EQ(m->count_freedoms(), 1);
    const double period = calc_period(std::sqrt(1.5 * kG / l), a);
    // Back at the start, at rest, after one period; in windows of 2 ms and in one go.
    for (const double window : {2e-3, 10.0}) {
      Coordinates now = m->get_start();
      double t = 0.0;
      while (t < period) {
        const double h = std::min(window, period - t);
        now = m->fly(now, h, kFine);
        t += h;
      }
      EXPECT_NEAR(now.q[0], 0.0, 1e-7 * a) << a;
      EXPECT_NEAR(now.u[0], 0.0, 1e-7 + 1e-6 * a) << a;  // the tolerance is absolute
    }
  }
}

TEST(mechanism, pendulum_energy_over_a_minute) {
  const std::vector<Member> members{make_bar(0.4, 0.6, {}, 2.5)};
  const auto m = make_mechanism(members, {make_hinge(0, -1, {})}, kGravity);
  Coordinates now = m->get_start();
  std::vector<Motion> motions;
  m->find_motions(now, motions);
  const double before = calc_energy(members, motions), swing = 0.4 * kG * 0.6;
  double worst = 0.0;
  for (int n = 0; n < 30000; ++n) {
    now = m->fly(now, 2e-3, kTolerance);
    m->find_motions(now, motions);
    worst = std::max(worst, std::abs(calc_energy(members, motions) - before));
  }
  EXPECT_LT(worst, 1e-6 * swing);
  EXPECT_EQ(now.lost_j, 0.0);
}

TEST(mechanism, double_pendulum) {
  // Two thin bars; equations of motion from the Lagrangian in the two angles, integrated here by the classical method with 10 us.
  const double m1 = 0.3, m2 = 0.2, l1 = 0.4, l2 = 0.3, a1 = 1.2, a2 = -0.4;
  const Vec3 middle{l1 * std::sin(a1), 0, -l1 * std::cos(a1)};
  const std::vector<Member> members{make_bar(m1, l1, {}, a1), make_bar(m2, l2, middle, a2)};
  const auto m = make_mechanism(members, {make_hinge(1, 0, middle), make_hinge(0, -1, {})}, kGravity);
  using X = std::array<double, 4>;
  const auto rates = [&](const X& x) {
    const double c = std::cos(x[0] - x[1]), s = std::sin(x[0] - x[1]);
    const double a = m1 * l1 * l1 / 3.0 + m2 * l1 * l1, b = 0.5 * m2 * l1 * l2 * c, d = m2 * l2 * l2 / 3.0;
    const double f = -0.5 * m2 * l1 * l2 * s * x[3] * x[3] - (0.5 * m1 + m2) * kG * l1 * std::sin(x[0]);
    const double g = 0.5 * m2 * l1 * l2 * s * x[2] * x[2] - 0.5 * m2 * kG * l2 * std::sin(x[1]);
    const double determinant = a * d - b * b;
    return X{x[2], x[3], (d * f - b * g) / determinant, (a * g - b * f) / determinant};
  };
  X x{a1, a2, 0, 0};
  Coordinates now = m->get_start();
  std::vector<Motion> motions;
  for (int window = 0; window < 500; ++window) {
    now = m->fly(now, 2e-3, kFine);
    for (int n = 0; n < 200; ++n) {
      const double h = 1e-5;
      const auto go = [&](double s, const X& k) {
        X y = x;
        for (std::size_t i = 0; i < 4; ++i) y[i] += s * k[i];
        return y;
      };
      const X k1 = rates(x), k2 = rates(go(0.5 * h, k1)), k3 = rates(go(0.5 * h, k2)), k4 = rates(go(h, k3));
      for (std::size_t i = 0; i < 4; ++i) x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
  }
  m->find_motions(now, motions);
  const Vec3 first = Vec3{0.5 * l1 * std::sin(x[0]), 0, -0.5 * l1 * std::cos(x[0])};
  const Vec3 second = 2.0 * first + Vec3{0.5 * l2 * std::sin(x[1]), 0, -0.5 * l2 * std::cos(x[1])};
  EXPECT_LT(norm(motions[0].centre - first), 1e-6);
  EXPECT_LT(norm(motions[1].centre - second), 1e-6);
  EXPECT_NEAR(motions[1].spin[1], -x[3], 1e-5);
}

TEST(mechanism, angular_momentum_of_ball_joint) {
  // A heavy top: a symmetrical body that spins and swings about a ball joint. Energy and both angular momenta stay.
  Member top;
  top.mass_kg = 0.3;
  top.inertia_kg_m2 = {Vec3{4e-4, 0, 0}, Vec3{0, 4e-4, 0}, Vec3{0, 0, 2e-4}};
  top.start.centre = {0.12, 0, -0.05};
  const Vec3 along = 1.0 / 0.13 * top.start.centre;
  const double tilt = std::acos(along[2]);
  top.start.rotation = {std::cos(0.5 * tilt), 0, std::sin(0.5 * tilt), 0};  // its z along the arm
  top.start.spin = 40.0 * along + Vec3{0, 0, 5.0};
  top.start.velocity = cross(top.start.spin, top.start.centre);
  const auto m = make_mechanism({top}, {{.kind = Kind::kBall, .body = 0, .to = -1, .at = {}}}, kGravity);
  ASSERT_EQ(m->count_freedoms(), 3);
  EXPECT_LT(m->get_start_error(), 1e-12);
  const auto look = [&](const Coordinates& c) {
    std::vector<Motion> motions;
    m->find_motions(c, motions);
    const Motion& now = motions[0];
    const Vec3 arm = 1.0 / norm(now.centre) * now.centre;
    const double about_arm = dot(now.spin, arm);
    const Vec3 angular = top.mass_kg * cross(now.centre, now.velocity) + 4e-4 * (now.spin - about_arm * arm) + (2e-4 * about_arm) * arm;
    return std::array<double, 4>{angular[2], about_arm, calc_energy({top}, motions), norm(now.centre)};
  };
  Coordinates now = m->get_start();
  const auto before = look(now);
  for (int n = 0; n < 5000; ++n) now = m->fly(now, 2e-3, kFine);
  const auto after = look(now);
  EXPECT_NEAR(after[0], before[0], 1e-7 * std::abs(before[0]));
  EXPECT_NEAR(after[1], before[1], 1e-7 * std::abs(before[1]));
  EXPECT_NEAR(after[2], before[2], 1e-7);
  EXPECT_NEAR(after[3], 0.13, 1e-12);  // the joint does not open
}

TEST(mechanism, centre_of_percussion) {
  // A bar hinged at its end: W = r r' / I; the reaction vanishes for a blow at 2/3 of its length.
  const double mass = 0.4, l = 0.6, inertia = mass * l * l / 3.0;
  const auto m = make_mechanism({make_bar(mass, l, {}, 0.0)}, {make_hinge(0, -1, {})}, kGravity);
  for (const double at : {0.2, 0.4, 0.55}) {
    const double p = 0.07;  // along x, at the depth `at`
    const Coordinates hit = m->move(m->get_start(), m->calc_push(m->get_start(), {{{p, 0, 0}, {0, -(at - 0.5 * l) * p, 0}}}), 1.0, 0.0);
    std::vector<Motion> motions;
    m->find_motions(hit, motions);
    EXPECT_NEAR(motions[0].velocity[0], 0.5 * l * at * p / inertia, 1e-12);
    EXPECT_NEAR(motions[0].spin[1], -at * p / inertia, 1e-12);
    const double reaction = mass * motions[0].velocity[0] - p;  // on the bar
    EXPECT_NEAR(reaction, p * (1.5 * at / l - 1.0), 1e-12);
  }
  // The mobility says the same: velocity at a depth d per impulse at a depth e.
  const std::vector<double> w = m->calc_mobility(m->get_start(), 0);
  const auto at = [&](int row, int column) { return w[6 * row + column]; };
  EXPECT_NEAR(at(0, 0), 0.25 * l * l / inertia, 1e-12);
  EXPECT_NEAR(at(4, 4), 1.0 / inertia, 1e-12);
  EXPECT_NEAR(at(4, 0), -0.5 * l / inertia, 1e-12);
  EXPECT_NEAR(at(2, 2), 0.0, 1e-15);
}

TEST(mechanism, momentum_by_mobility_of_free_pair) {
  // Two bars on a ball joint that nothing holds: an impulse on one gives both together just that momentum.
  std::vector<Member> members{make_bar(0.3, 0.4, {}, 0.3), make_bar(0.7, 0.5, {}, -1.0)};
  const auto m = make_mechanism(members, {{.kind = Kind::kBall, .body = 1, .to = 0, .at = {}}}, {});
  ASSERT_EQ(m->count_freedoms(), 9);
  const std::vector<double> w = m->calc_mobility(m->get_start(), 1);
  for (int column = 0; column < 3; ++column) {
    Vec3 momentum{};
    for (int body = 0; body < 2; ++body)
      for (std::size_t k = 0; k < 3; ++k) momentum[k] += members[body].mass_kg * w[6 * (6 * body + k) + static_cast<std::size_t>(column)];
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(momentum[k], k == column ? 1.0 : 0.0, 1e-12);
  }
}

TEST(mechanism, no_drift_of_hanging_chain) {
  std::vector<Member> members;
  std::vector<Joint> joints;
  for (int i = 0; i < 20; ++i) {
    const Vec3 top{0, 0, -0.05 * i};
    members.push_back(make_bar(0.01, 0.05, top, 0.0));
    joints.push_back({.kind = Kind::kBall, .body = i, .to = i - 1, .at = top});
  }
  const auto m = make_mechanism(members, joints, kGravity);
  Coordinates now = m->get_start();
  for (int n = 0; n < 1000; ++n) now = m->fly(now, 2e-3, kFine);
  std::vector<Motion> motions;
  m->find_motions(now, motions);
  for (std::size_t i = 0; i < motions.size(); ++i) EXPECT_LT(norm(motions[i].centre - members[i].start.centre), 1e-12);
}

TEST(mechanism, energy_loss_of_damped_hinge) {
  // Small swings: a exp(-d t) with d = c / 2 I.
  const double mass = 0.4, l = 0.6, c = 0.02, inertia = mass * l * l / 3.0, a = 1e-3;
  const std::vector<Member> members{make_bar(mass, l, {}, a)};
  Joint hinge = make_hinge(0, -1, {});
  hinge.damping = c;
  const auto m = make_mechanism(members, {hinge}, kGravity);
  Coordinates now = m->get_start();
  std::vector<Motion> motions;
  m->find_motions(now, motions);
  const double before = calc_energy(members, motions);
  const double w0 = std::sqrt(0.5 * mass * kG * l / inertia), d = 0.5 * c / inertia, w = std::sqrt(w0 * w0 - d * d), t = 3.0;
  for (int n = 0; n < 1500; ++n) now = m->fly(now, 2e-3, kFine);
  m->find_motions(now, motions);
  const double angle = std::atan2(motions[0].centre[0], -motions[0].centre[2]);
  EXPECT_NEAR(angle, a * std::exp(-d * t) * (std::cos(w * t) + d / w * std::sin(w * t)), 1e-5 * a);
  EXPECT_NEAR(before - calc_energy(members, motions), now.lost_j, 1e-12);
  EXPECT_GT(now.lost_j, 0.0);
}

TEST(mechanism, fall_along_slider) {
  Member m = make_bar(0.4, 0.6, {}, 0.0);
  const Vec3 axis{0.6, 0.0, -0.8};
  const auto s = make_mechanism({m}, {{.kind = Kind::kSlider, .body = 0, .to = -1, .at = {1, 2, 3}, .axis = axis}}, kGravity);
  const Coordinates now = s->fly(s->get_start(), 0.7, kFine);
  std::vector<Motion> motions;
  s->find_motions(now, motions);
  EXPECT_LT(norm(motions[0].centre - m.start.centre - (0.5 * 0.8 * kG * 0.49) * axis), 1e-9);
}

TEST(mechanism, no_twist_of_universal_joint) {
  // Hung by its end: it may swing both ways, and the middle of its length stays across the axis that is fixed in it.
  Member bar = make_bar(0.4, 0.6, {}, 0.0);
  bar.start.spin = {2.0, 1.0, 0.0};
  bar.start.velocity = cross(bar.start.spin, bar.start.centre);
  const auto m = make_mechanism(
      {bar}, {{.kind = Kind::kUniversal, .body = 0, .to = -1, .at = {}, .axis = {1, 0, 0}, .second_axis = {0, 1, 0}}}, kGravity);
  ASSERT_EQ(m->count_freedoms(), 2);
  EXPECT_LT(m->get_start_error(), 1e-12);
  Coordinates now = m->get_start();
  std::vector<Motion> motions;
  m->find_motions(now, motions);
  const double before = calc_energy({bar}, motions);
  for (int n = 0; n < 500; ++n) now = m->fly(now, 2e-3, kFine);
  m->find_motions(now, motions);
  EXPECT_NEAR(calc_energy({bar}, motions), before, 1e-8);
  const auto& q = motions[0].rotation;
  const Vec3 second{2 * (q[1] * q[2] - q[0] * q[3]), 1 - 2 * (q[1] * q[1] + q[3] * q[3]), 2 * (q[2] * q[3] + q[0] * q[1])};
  EXPECT_NEAR(second[0], 0.0, 1e-12);  // the second axis stays across the first
}

TEST(mechanism, welded_bodies) {
  std::vector<Member> members{make_bar(0.3, 0.4, {}, 0.0), make_bar(0.3, 0.4, {0, 0, -0.4}, 0.0)};
  const auto welded =
      make_mechanism(members, {make_hinge(0, -1, {}), {.kind = Kind::kWeld, .body = 1, .to = 0, .at = {0, 0, -0.4}}}, kGravity);
  const auto whole = make_mechanism({make_bar(0.6, 0.8, {}, 0.0)}, {make_hinge(0, -1, {})}, kGravity);
  ASSERT_EQ(welded->count_freedoms(), 1);
  const double p = 0.2;
  const std::vector<double> du = welded->calc_push(welded->get_start(), {{{p, 0, 0}, {}}, {}});
  const std::vector<double> one = whole->calc_push(whole->get_start(), {{{p, 0, 0}, {0, 0.2 * p, 0}}});
  EXPECT_NEAR(du[0], one[0], 1e-12);
}

TEST(mechanism, report_of_incompatible_velocities) {
  Member bar = make_bar(0.4, 0.6, {}, 0.0);
  bar.start.velocity = {0, 0.5, 0};  // along the axis
  EXPECT_NEAR(make_mechanism({bar}, {make_hinge(0, -1, {})}, kGravity)->get_start_error(), 0.5, 1e-12);
}

TEST(mechanism, refusal_of_loops_and_loose_members) {
  const std::vector<Member> members{make_bar(0.3, 0.4, {}, 0.0), make_bar(0.3, 0.4, {0, 0, -0.4}, 0.0)};
  EXPECT_THROW(make_mechanism(members, {make_hinge(0, -1, {}), make_hinge(1, 0, {0, 0, -0.4}), make_hinge(1, -1, {0, 0, -0.8})}, kGravity),
               std::invalid_argument);
  EXPECT_THROW(make_mechanism(members, {make_hinge(0, -1, {})}, kGravity), std::invalid_argument);
}

TEST(mechanism, same_bits_again) {
  const std::vector<Member> members{make_bar(0.3, 0.4, {}, 0.3)};
  const auto a = make_mechanism(members, {make_hinge(0, -1, {})}, kGravity), b = make_mechanism(members, {make_hinge(0, -1, {})}, kGravity);
  Coordinates x = a->get_start(), y = b->get_start();
  for (int n = 0; n < 100; ++n) {
    x = a->fly(x, 2e-3, kFine);
    (void)b->fly(y, 1e-3, kFine);
    y = b->fly(y, 2e-3, kFine);
    ASSERT_EQ(x.q, y.q);
    ASSERT_EQ(x.u, y.u);
  }
}

}  // namespace
}  // namespace carillon::joints

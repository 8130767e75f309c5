// A given restitution is an upper limit of the total one, of the contact and of bending bodies.
#include <array>

#include "tests/unit/runtime/physics/impact/scenes.hpp"

namespace carillon::impact::tests {
namespace {

/// A free slender bar in the plane x, z about its middle (Euler and Bernoulli), struck across at x: its modes and their shapes there.
struct Bar {
  std::vector<double> omega, shape;
  double mass = 0.0, length = 0.0;
};
Bar make_bar(double length, double width, double thickness, double x, double highest_hz) {
  Bar bar;
  bar.mass = kDensity * length * width * thickness;
  bar.length = length;
  const double stiffness = std::sqrt(kYoung * thickness * thickness / 12.0 / kDensity);
  for (int k = 1; k < 60; ++k) {
    // cos(b) cosh(b) = 1: by Newton from (k + 1/2) pi, in the form that does not overflow.
    double b = (k + 0.5) * kPi;
    for (int i = 0; i < 20; ++i) b -= (std::cos(b) - 1.0 / std::cosh(b)) / (-std::sin(b) + std::tanh(b) / std::cosh(b));
    const double omega = b * b / (length * length) * stiffness;
    if (omega > 2.0 * kPi * highest_hz) break;
    // Even modes cos + cosh, odd ones sin + sinh, about the middle; mean square 1 over the bar.
    const double half = 0.5 * b, at = b * x / length;
    const bool even = k % 2 == 1;
    const double phi = even ? std::cos(at) / std::cos(half) + std::cosh(at) / std::cosh(half)
                            : std::sin(at) / std::sin(half) + std::sinh(at) / std::sinh(half);
    bar.omega.push_back(omega);
    bar.shape.insert(bar.shape.end(), {0.0, 0.0, phi / std::sqrt(bar.mass)});
  }
  return bar;
}

struct Rebound {
  double elastic = 0.0, given = 0.0;  // with a restitution of 1, and with the one given; of the bodies as rigid ones, at the contact
  double braked = 0.0;                // share of the impulse on the surfaces that the limit kept from the rigid bodies
};

Vec3 calc_momentum(const Body& ball, const Body& below) { return ball.mass_kg * ball.velocity_m_s + below.mass_kg * below.velocity_m_s; }

/// Rebound of a ball from a body at rest with modes, `x` from its centre. Checks the invariants of impacts.
Rebound calc_rebound(const Body& below, const std::vector<double>& shape, double radius, double speed, double x, double restitution,
                     double friction = 0.0) {
  Rebound rebound;
  for (const double e : {1.0, restitution}) {
    Body ball = make_ball(radius, {friction > 0.0 ? 0.7 * speed : 0.0, 0, -speed});
    ball.centre_m[0] = x;
    std::vector<Contact> contacts{make_contact(radius, 0, 1)};
    contacts[0].where_m = {x, 0, 0};
    contacts[0].shape_b = shape;
    contacts[0].restitution = e;
    contacts[0].is_limit = true;
    contacts[0].friction = friction;
    Impact impact = run({ball, below}, contacts);
    const double parting = -impact.calc_approach(0) / speed;
    (e == 1.0 ? rebound.elastic : rebound.given) = parting;
    const Books books = impact.get_books();
    EXPECT_LE(books.rigid + books.modal, books.start * (1.0 + 1e-12));
    // Free bodies keep their momentum, however much the limit keeps from both.
    const std::vector<Body> after = impact.get_bodies();
    if (below.mass_kg > 0.0) {
      EXPECT_LE(norm(calc_momentum(after[0], after[1]) - calc_momentum(ball, below)), 1e-12 * ball.mass_kg * speed);
    }
    double impulse = 0.0;
    for (const Pulse& pulse : impact.take_pulses())
      for (const Vec3& j : pulse.impulse_n_s) impulse += dot(j, contacts[0].normal);
    const double change = ball.mass_kg * dot(after[0].velocity_m_s - ball.velocity_m_s, contacts[0].normal);
    EXPECT_GE(impulse, change * (1.0 - 1e-9));
    rebound.braked = (impulse - change) / impulse;
  }
  return rebound;
}

void expect_limited(const Rebound& rebound, double restitution, int& limited) {
  EXPECT_LE(rebound.given, restitution * (1.0 + 1e-5));
  if (rebound.elastic > 1.02 * restitution) ++limited;
}

TEST(Limit, BallOnSupportedPlate) {
  int limited = 0;
  for (const double thickness : {0.002, 0.004, 0.01})
    for (const double radius : {0.005, 0.01, 0.02, 0.04}) {
      const Plate plate = make_plate(0.2, 0.18, thickness, 15e3, 0.094, 0.0954);
      const Modes modes(plate.omega, plate.decay, 2.0 * kPi * 15e3);
      Body below;
      below.modes = &modes;
      for (const double e : {0.1, 0.5, 0.8}) expect_limited(calc_rebound(below, plate.shape, radius, 1.0, 0.0, e), e, limited);
    }
  EXPECT_GT(limited, 8);
}

TEST(Limit, YieldedThenDissipatedEnergy) {
  int limited = 0;
  for (const double thickness : {0.002, 0.004, 0.01})
    for (const double radius : {0.01, 0.02, 0.04}) {
      const Plate plate = make_plate(0.2, 0.18, thickness, 15e3, 0.094, 0.0954);
      const Modes modes(plate.omega, plate.decay, 2.0 * kPi * 15e3);
      Body below;
      below.modes = &modes;
      std::vector<Contact> contacts{make_contact(radius, 0, 1)};
      contacts[0].shape_b = plate.shape;
      contacts[0].restitution = 0.1;
      contacts[0].is_limit = true;
      Impact impact({make_ball(radius, {0, 0, -1.0}), below}, contacts, {.above_band = false});
      double most_j = 0.0;
      for (int n = 1; n < 10000 && !impact.advance(5e-6 * n); ++n) {
        const Books books = impact.get_books();
        EXPECT_LE(std::abs(books.calc_error()), 1e-10);
        EXPECT_GE(books.yielded, 0.0);
        most_j = std::max(most_j, books.yielded);
        // The limited ball parts slower than the plate swings back; the plate swings into it by the compression without force at most.
        const std::vector<double> q = impact.get_bodies()[1].q;
        double bent_m = 0.0;
        for (std::size_t m = 0; m < q.size(); ++m) bent_m -= plate.shape[3 * m + 2] * q[m];
        const double unexplained_m = impact.calc_depth(0) - std::max(impact.get_compression(0), 0.0) - bent_m;
        EXPECT_GT(unexplained_m, -1e-9);
        EXPECT_LT(unexplained_m, 6.5e-5);
      }
      EXPECT_TRUE(impact.has_ended());
      EXPECT_GE(impact.get_books().dissipated_contact + impact.get_books().yielded, most_j);
      limited += most_j > 1e-3 * impact.get_books().start ? 1 : 0;
      expect_sound(impact, contacts);
    }
  EXPECT_GT(limited, 2);
}

/// A bar that flies, with its modes.
Body make_free(const Bar& bar, const Modes& modes) {
  Body body;
  body.modes = &modes;
  body.mass_kg = bar.mass;
  const double across = bar.mass * bar.length * bar.length / 12.0;
  body.inertia_kg_m2 = {{{0.01 * across, 0, 0}, {0, across, 0}, {0, 0, across}}};
  return body;
}

TEST(Limit, BallOnFreeBar) {
  int limited = 0, braked = 0;
  for (const double x : {0.0, 0.03, 0.07, 0.1})
    for (const double radius : {0.005, 0.012, 0.03})
      for (const double friction : {0.0, 0.3}) {
        const Bar bar = make_bar(0.2, 0.03, 0.006, x, 20e3);
        const Modes modes(bar.omega, std::vector<double>(bar.omega.size(), 2.0), 2.0 * kPi * 20e3);
        const Body below = make_free(bar, modes);
        for (const double e : {0.1, 0.5, 0.8}) {
          const Rebound rebound = calc_rebound(below, bar.shape, radius, 1.0, x, e, friction);
          expect_limited(rebound, e, limited);
          braked += rebound.braked > 1e-3 ? 1 : 0;
        }
      }
  EXPECT_GT(braked, 0);
  EXPECT_GT(limited, 8);
}

TEST(Limit, BallOnBlock) {
  // Modes far above the pulse: the contact is the only loss.
  const Modes modes(std::vector<double>{2.0 * kPi * 60e3, 2.0 * kPi * 90e3}, std::vector<double>{5.0, 5.0});
  Body below;
  below.modes = &modes;
  below.mass_kg = 60.0;
  below.inertia_kg_m2 = {{{0.4, 0, 0}, {0, 0.4, 0}, {0, 0, 0.4}}};
  const std::vector<double> shape{0, 0, 0.2, 0, 0, 0.2};
  for (const double e : {0.1, 0.5, 0.8, 0.95}) {
    const Rebound rebound = calc_rebound(below, shape, 0.02, 1.0, 0.0, e);
    EXPECT_LE(rebound.given, e * (1.0 + 1e-5));
    EXPECT_NEAR(rebound.given, e, 0.01 * e);
  }
}

TEST(Limit, TwoContactsOnOneBar) {
  for (const double e : {0.2, 0.6}) {
    const Bar left = make_bar(0.2, 0.03, 0.006, -0.05, 20e3), right = make_bar(0.2, 0.03, 0.006, 0.08, 20e3);
    const Modes modes(left.omega, std::vector<double>(left.omega.size(), 2.0), 2.0 * kPi * 20e3);
    const Body below = make_free(left, modes);
    std::vector<Body> bodies{make_ball(0.012, {0, 0, -1.0}), make_ball(0.02, {0, 0, -0.8}), below};
    bodies[0].centre_m[0] = -0.05;
    bodies[1].centre_m[0] = 0.08;
    std::vector<Contact> contacts{make_contact(0.012, 0, 2), make_contact(0.02, 1, 2)};
    contacts[0].where_m = {-0.05, 0, 0};
    contacts[1].where_m = {0.08, 0, 0};
    contacts[0].shape_b = left.shape;
    contacts[1].shape_b = right.shape;
    for (Contact& contact : contacts) contact.restitution = e, contact.friction = 0.2, contact.is_limit = true;
    Impact impact = run(bodies, contacts);
    // A blow on one side may lift the other; the rebound of each contact is limited, and so is their sum here.
    EXPECT_LE(-impact.calc_approach(0), 1.3 * e);
    EXPECT_LE(-impact.calc_approach(1), 1.3 * e);
  }
}

TEST(Limit, NoPenetrationUnderLongPressure) {
  // A ball lies on a plate for 0.3 s; then something presses it down. Springs and modes yield by some 20 um.
  const Plate plate = make_plate(0.2, 0.18, 0.004, 15e3, 0.094, 0.0954, 50.0);
  const Modes modes(plate.omega, plate.decay, 2.0 * kPi * 15e3);
  Body ball = make_ball(0.02, {}), below;
  ball.acceleration_m_s2 = {0, 0, -9.81};
  below.modes = &modes;
  std::vector<Contact> contacts{make_contact(0.02, 0, 1)};
  contacts[0].shape_b = plate.shape;
  contacts[0].restitution = 0.5;
  contacts[0].is_limit = true;
  Impact impact({ball, below}, contacts);
  EXPECT_FALSE(impact.advance(0.3));
  const double before_m = impact.get_bodies()[0].moved_m[2];
  impact.push(0, {0, 0, -0.05}, {});
  double deepest_m = 0.0;
  for (int n = 1; n <= 40; ++n) {
    impact.advance(0.3 + 5e-4 * n);
    deepest_m = std::max(deepest_m, before_m - impact.get_bodies()[0].moved_m[2]);
    // Depth is compression, yielded compression and the bending of the plate.
    if (impact.get_compression(0) > 0.0) {
      EXPECT_NEAR(impact.calc_depth(0), -impact.get_bodies()[0].moved_m[2], 1e-9);
    }
  }
  EXPECT_LT(deepest_m, 1e-4);
  expect_sound(impact, contacts);
}

}  // namespace
}  // namespace carillon::impact::tests

// Friction in an impact and in a contact that lasts: slip, stick, the cone, the rebound of tangential motion.
#include <array>

#include "tests/unit/runtime/physics/impact/scenes.hpp"

namespace carillon::impact::tests {
namespace {

constexpr double kRadius = 0.015;

/// Speed of the ball's lowest point along x.
double calc_slip(const Body& ball) { return ball.velocity_m_s[0] - kRadius * ball.spin_rad_s[1]; }

TEST(Friction, GrossSlidingImpulse) {
  // Slip never ends: dv = mu J/m, and the contact point slows by 7/2 of it. J = 2 m v.
  const double mu = 0.1, v = 1.0, along = 3.0;
  std::vector<Contact> contacts{make_contact(kRadius)};
  contacts[0].friction = mu;
  Impact impact = run({make_ball(kRadius, {along, 0, -v})}, contacts, {.steps_per_pulse = 40.0});
  const Body after = impact.get_bodies()[0];
  EXPECT_NEAR(after.velocity_m_s[2], v, 1e-11);
  // At the very end the anchor spring releases its energy: mu F k^-1 F'.
  EXPECT_NEAR(after.velocity_m_s[0], along - 2.0 * mu * v, 2e-3 * 2.0 * mu * v);
  EXPECT_NEAR(calc_slip(after), along - 7.0 * mu * v, 2e-3 * 7.0 * mu * v);
  // Work of friction: mean slip times impulse.
  EXPECT_NEAR(impact.get_books().dissipated_friction, mu * 2.0 * impact.get_bodies()[0].mass_kg * v * (along - 3.5 * mu * v),
              5e-3 * impact.get_books().dissipated_friction);
}

TEST(Friction, AngularMomentumAboutContact) {
  for (const double mu : {0.05, 0.3, 1.0})
    for (const double along : {0.2, 1.0, 4.0}) {
      std::vector<Contact> contacts{make_contact(kRadius)};
      contacts[0].friction = mu;
      Body ball = make_ball(kRadius, {along, 0.3 * along, -1.0});
      ball.spin_rad_s = {20.0, -35.0, 10.0};
      const Body after = run({ball}, contacts).get_bodies()[0];
      EXPECT_NEAR(after.velocity_m_s[0] + 0.4 * kRadius * after.spin_rad_s[1], along - 0.4 * kRadius * 35.0, 1e-12);
      EXPECT_NEAR(after.velocity_m_s[1] - 0.4 * kRadius * after.spin_rad_s[0], 0.3 * along - 0.4 * kRadius * 20.0, 1e-12);
      EXPECT_NEAR(after.spin_rad_s[2], 10.0, 1e-12);
    }
}

TEST(Friction, SlidingToRollingAtFiveSevenths) {
  // A ball pressed by gravity alone: v = 5/7 v0 after 2 v0/(7 mu g) and 12 v0^2/(49 mu g).
  const double mu = 0.3, v0 = 0.5, g = 9.81;
  std::vector<Contact> contacts{make_contact(kRadius)};
  Body ball = make_ball(kRadius, {v0, 0, 0});
  ball.acceleration_m_s2 = {0, 0, -g};
  contacts[0].friction = mu;
  contacts[0].gap_m = -std::pow(ball.mass_kg * g / contacts[0].spring.stiffness, 2.0 / 3.0);
  Impact impact({ball}, contacts);
  const double time = 2.0 * v0 / (7.0 * mu * g);
  EXPECT_FALSE(impact.advance(0.5 * time));
  EXPECT_NEAR(impact.get_bodies()[0].velocity_m_s[0], v0 - 0.5 * mu * g * time, 2e-3 * v0);
  EXPECT_FALSE(impact.advance(time));
  EXPECT_NEAR(impact.get_bodies()[0].moved_m[0], 12.0 * v0 * v0 / (49.0 * mu * g), 5e-3 * 0.0208);
  EXPECT_FALSE(impact.advance(1.5 * time));
  const Body after = impact.get_bodies()[0];
  EXPECT_NEAR(after.velocity_m_s[0], 5.0 / 7.0 * v0, 5e-3 * v0);
  EXPECT_NEAR(calc_slip(after), 0.0, 1e-2 * v0);
  EXPECT_NEAR(after.velocity_m_s[2], 0.0, 1e-9);  // it lies in its equilibrium
  expect_sound(impact, contacts);
  // Friction took the energy that the rolling ball lacks: 1/7 of the translation, 2/7 m v0^2/2.
  EXPECT_NEAR(impact.get_books().dissipated_friction, 2.0 / 7.0 * 0.5 * ball.mass_kg * v0 * v0, 0.02 * 0.5 * ball.mass_kg * v0 * v0);
}

TEST(Friction, LosslessStickingOscillation) {
  // A ball pressed hard and pushed softly: the anchor spring and 2/7 of the mass (7/2 of the mobility) swing, and nothing is lost.
  const double press = 1e4, v0 = 1e-4;
  std::vector<Contact> contacts{make_contact(kRadius)};
  Body ball = make_ball(kRadius, {v0, 0.5 * v0, 0});
  ball.acceleration_m_s2 = {0, 0, -press};
  contacts[0].friction = 0.3;
  const double K = contacts[0].spring.stiffness, y = std::pow(ball.mass_kg * press / K, 2.0 / 3.0);
  contacts[0].gap_m = -y;
  const double k_t = contacts[0].tangential_ratio * K * std::sqrt(y), period = 2.0 * kPi / std::sqrt(3.5 * k_t / ball.mass_kg);
  Impact impact({ball}, contacts, {.longest_step_s = period / 400});
  impact.advance(7.25 * period);
  const Books books = impact.get_books();
  const double motion = 0.5 * ball.mass_kg * 1.25 * v0 * v0;
  EXPECT_NEAR(books.dissipated_friction, 0.0, 1e-12 * motion);
  // At a quarter of a period 2/7 of the energy is in the spring, the slip has stopped, and v has gone to 5/7.
  EXPECT_NEAR(books.rigid, 5.0 / 7.0 * motion, 1e-3 * motion);
  EXPECT_NEAR(impact.get_bodies()[0].velocity_m_s[0], 5.0 / 7.0 * v0, 0.03 * v0);
  EXPECT_NEAR(impact.get_bodies()[0].velocity_m_s[1], 2.5 / 7.0 * v0, 0.03 * v0);
  expect_sound(impact, contacts);
}

TEST(Friction, TangentialReboundOfElasticSpheres) {
  // Maw, Barber and Fawcett 1976: with psi = 2 (1 - nu)/(2 - nu) v_t/(mu v_n), a solid sphere slides all the way for
  // psi_1 > 4 chi - 1 = 4.76 (chi = 7/2 (1 - nu)/(2 - nu)), and comes back reversed from small angles. psi_2 = psi_1 - 7 kappa there.
  const double mu = 0.2, kappa = 2.0 * (1.0 - kPoisson) / (2.0 - kPoisson);
  double min = 0.0;
  for (double psi = 0.25; psi < 8.0; psi += 0.25) {
    std::vector<Contact> contacts{make_contact(kRadius)};
    contacts[0].friction = mu;
    contacts[0].tangential_ratio = kappa;
    const Body after = run({make_ball(kRadius, {psi * mu / kappa, 0, -1.0})}, contacts, {.steps_per_pulse = 64.0}).get_bodies()[0];
    const double rebound = calc_slip(after) * kappa / mu;
    EXPECT_LE(std::abs(rebound), psi * (1.0 + 1e-9)) << psi;  // never faster than it came
    if (psi > 5.8) {
      EXPECT_NEAR(rebound, psi - 7.0 * kappa, 0.02) << psi;
    }
    if (psi < 3.0 && psi >= 1.0) {
      EXPECT_LT(rebound, 0.0) << psi;
    }
    min = std::min(min, rebound);
  }
  EXPECT_LT(min, -0.5);  // published curves for nu = 0.3 go down to about -1
  EXPECT_GT(min, -1.8);
}

TEST(Friction, SeveralPointsWithinCones) {
  // A box that lands on four corners while it slides and spins; the forces of every step are looked at by run().
  for (const double mu : {0.05, 0.3, 1.2}) {
    Body box;
    box.mass_kg = 0.8;
    box.inertia_kg_m2 = {{{1.1e-3, 1e-4, 0}, {1e-4, 0.9e-3, 0}, {0, 0, 1.4e-3}}};
    box.centre_m = {0, 0, 0.04};
    box.velocity_m_s = {0.7, -0.2, -1.5};
    box.spin_rad_s = {0.5, -1.0, 9.0};
    std::vector<Contact> contacts;
    for (const auto& [x, y] : std::to_array<std::array<double, 2>>({{0.05, 0.05}, {-0.05, 0.04}, {-0.06, -0.05}, {0.05, -0.05}})) {
      contacts.push_back(make_contact(1e-3));
      contacts.back().where_m = {x, y, 0};
      contacts.back().friction = mu;
      contacts.back().restitution = 0.8;
    }
    Impact impact = run({box}, contacts);
    EXPECT_GT(impact.get_books().dissipated_friction, 0.0);
    EXPECT_LT(impact.get_books().rigid, impact.get_books().start);
  }
}

TEST(Friction, ExcitationOfTangentialModes) {
  // A mode along x that only friction can reach.
  const Modes modes(std::array{2.0 * kPi * 900.0}, std::array{2.0});
  const std::vector<double> shape{0.8, 0.0, 0.0};
  Body table;
  table.modes = &modes;
  std::vector<Contact> contacts{make_contact(kRadius, 0, 1)};
  contacts[0].friction = 0.3;
  contacts[0].shape_b = shape;
  Impact impact = run({make_ball(kRadius, {1.0, 0, -1.0}), table}, contacts);
  const Body ball = impact.get_bodies()[0];
  EXPECT_GT(impact.get_books().modal, 0.0);
  // About 0.8 J: the pulse is short relative to the period, and its later part counts a little less.
  const double impulse = -ball.mass_kg * (ball.velocity_m_s[0] - 1.0);
  EXPECT_NEAR(std::sqrt(2.0 * impact.get_books().modal), 0.8 * impulse, 0.2 * 0.8 * impulse);
}

}  // namespace
}  // namespace carillon::impact::tests

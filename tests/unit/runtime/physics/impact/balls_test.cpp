// Rigid bodies on springs: Hertz, Hunt and Crossley, Newton's cradle, felt, flush boxes.
#include <array>

#include "tests/unit/runtime/physics/impact/scenes.hpp"

namespace carillon::impact::tests {
namespace {

TEST(Balls, ElasticHertzReboundAtAnyStep) {
  for (const double v : {1e-5, 0.01, 1.0, 100.0})
    for (const double steps : {1.0, 3.0, 5.0, 8.0, 20.0, 64.0, 500.0}) {
      const std::vector<Contact> contacts{make_contact(0.01)};
      Impact impact = run({make_ball(0.01, {0, 0, -v})}, contacts, {.steps_per_pulse = steps});
      EXPECT_NEAR(impact.get_bodies()[0].velocity_m_s[2] / v, 1.0, 1e-12) << v << " " << steps;
      EXPECT_NEAR(impact.get_impulse(0), 2.0 * make_ball(0.01, {}).mass_kg * v, 1e-12 * v);
    }
}

TEST(Balls, HertzContactTime) {
  const double v = 1.0, radius = 0.01;
  const Body ball = make_ball(radius, {0, 0, -v});
  const std::vector<Contact> contacts{make_contact(radius)};
  Impact impact = run({ball}, contacts, {.steps_per_pulse = 2000.0});
  const auto pulses = impact.take_pulses();
  ASSERT_EQ(pulses.size(), 1U);
  // 2.87 (m^2 / (R E*^2 v))^(1/5)
  const double e_star = kYoung / (1.0 - kPoisson * kPoisson) / 2.0;
  const double tau = 2.868 * std::pow(ball.mass_kg * ball.mass_kg / (radius * e_star * e_star * v), 0.2);
  EXPECT_NEAR(static_cast<double>(pulses[0].impulse_n_s.size()) * pulses[0].step_s, tau, 1.5e-3 * tau);
  double largest = 0.0;
  for (const Vec3& j : pulses[0].impulse_n_s) largest = std::max(largest, j[2] / pulses[0].step_s);
  const double K = contacts[0].spring.stiffness;
  EXPECT_NEAR(largest, 1.143263 * K * std::pow(v * std::pow(ball.mass_kg / (K * std::sqrt(v)), 0.4), 1.5),
              1e-3 * largest);  // peak of Zener's lambda = 0
}

TEST(Balls, HuntCrossleyLoss) {
  for (const double e : {0.95, 0.7, 0.5, 0.2}) {
    std::vector<Contact> contacts{make_contact(0.01)};
    contacts[0].restitution = e;
    Impact impact = run({make_ball(0.01, {0, 0, -2.0})}, contacts, {.steps_per_pulse = 400.0});
    EXPECT_NEAR(impact.get_bodies()[0].velocity_m_s[2] / 2.0, e, 2e-4) << e;
    EXPECT_NEAR(impact.get_books().dissipated_contact / impact.get_books().start, 1.0 - e * e, 3e-4);
    Impact coarse = run({make_ball(0.01, {0, 0, -2.0})}, contacts);
    EXPECT_NEAR(coarse.get_bodies()[0].velocity_m_s[2] / 2.0, e, 6e-3) << e;
  }
}

TEST(Balls, NewtonsCradle) {
  // Touching Hertz balls, velocities after over that before: own integration (Verlet, 30,000 steps).
  const std::vector<std::vector<double>> wanted{
      {-.0710, .0764, .9945}, {-.0711, -.0303, -.0145, .1270, .9888}, {-.0711, -.0303, -.0158, -.0089, -.0024, .1418, .9867}};
  for (const auto& row : wanted) {
    std::vector<Body> bodies;
    std::vector<Contact> contacts;
    for (std::size_t i = 0; i < row.size(); ++i) {
      bodies.push_back(make_ball(0.01, {i == 0 ? 1.0 : 0.0, 0, 0}));
      bodies.back().centre_m = {0.02 * static_cast<double>(i), 0, 0};
      if (i == 0) continue;
      contacts.push_back(make_contact(0.005, static_cast<int>(i), static_cast<int>(i) - 1));
      contacts.back().normal = {1, 0, 0};
      contacts.back().where_m = {0.02 * static_cast<double>(i) - 0.01, 0, 0};
    }
    const auto after = run(bodies, contacts, {.steps_per_pulse = 80.0, .part_s = 2e-3}).get_bodies();
    double momentum = 0.0;
    for (std::size_t i = 0; i < row.size(); ++i) {
      EXPECT_NEAR(after[i].velocity_m_s[0], row[i], 3e-4) << row.size() << " balls, " << i;
      momentum += after[i].velocity_m_s[0];
    }
    EXPECT_NEAR(momentum, 1.0, 1e-12);
  }
}

TEST(Balls, WorkOfGravityInEnergyBalance) {
  // A soft long contact in which gravity does as much as the impact.
  Body ball = make_ball(0.02, {0, 0, -0.05});
  ball.acceleration_m_s2 = {0, 0, -9.81};
  std::vector<Contact> contacts{make_contact(0.02)};
  contacts[0].spring = {3e3, 1.0, 0.0};
  Impact impact = run({ball}, contacts, {.steps_per_pulse = 50.0, .part_s = 1e-9});
  const Books books = impact.get_books();
  const Body after = impact.get_bodies()[0];
  EXPECT_NEAR(books.given, -ball.mass_kg * 9.81 * after.moved_m[2], 1e-15);
  EXPECT_NEAR(0.5 * after.velocity_m_s[2] * after.velocity_m_s[2] + 9.81 * after.moved_m[2], 0.5 * 0.05 * 0.05, 1e-15);
  EXPECT_GT(after.velocity_m_s[2], 0.03);
}

TEST(Balls, FlushBoxesWithoutSpin) {
  for (const double mu : {0.0, 0.4})
    for (const double e : {1.0, 0.5}) {
      Body box;
      box.mass_kg = 0.8;
      box.inertia_kg_m2 = {{{1.1e-3, 0, 0}, {0, 1.1e-3, 0}, {0, 0, 1.4e-3}}};
      box.centre_m = {0, 0, 0.04};
      box.velocity_m_s = {0, 0, -1.5};
      std::vector<Contact> contacts;
      for (const auto& [x, y] : std::to_array<std::array<double, 2>>({{0.05, 0.05}, {-0.05, 0.05}, {-0.05, -0.05}, {0.05, -0.05}})) {
        contacts.push_back(make_contact(1e-3));
        contacts.back().where_m = {x, y, 0};
        contacts.back().friction = mu;
        contacts.back().restitution = e;
      }
      Impact impact = run({box}, contacts);
      const Body after = impact.get_bodies()[0];
      for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(after.spin_rad_s[i], 0.0, 1e-12 * 1.5 / 0.05);
      EXPECT_NEAR(after.velocity_m_s[0], 0.0, 1e-12);
      EXPECT_NEAR(after.velocity_m_s[1], 0.0, 1e-12);
      for (int c = 1; c < 4; ++c) EXPECT_NEAR(impact.get_impulse(c) / impact.get_impulse(0), 1.0, 1e-12);
      if (e == 1.0) {
        EXPECT_NEAR(after.velocity_m_s[2], 1.5, 1e-12);
      }
    }
}

TEST(Balls, FeltMalletPulse) {
  // A felt hammer of 9 g on a heavy block: F = K y^2.5, length and peak of its pulse against quadrature of the energy integral.
  const double m = 0.009, v = 3.0, p = 2.5, K = 4e9;
  Body mallet;
  mallet.mass_kg = m;
  mallet.velocity_m_s = {0, 0, -v};
  std::vector<Contact> contacts{make_contact(0.01)};
  contacts[0].spring = {K, p, 0.0};
  Impact impact = run({mallet}, contacts, {.steps_per_pulse = 1000.0});
  EXPECT_NEAR(impact.get_bodies()[0].velocity_m_s[2], v, 1e-11);
  const double peak = std::pow((p + 1) / 2 * m * v * v / K, 1 / (p + 1));
  double time = 0.0;  // 2 int dy / (v sqrt(1 - (y/peak)^(p+1))), y = peak (1 - s^2)
  for (int i = 0; i < 20000; ++i) {
    const double s = (i + 0.5) / 20000;
    time += 2.0 * peak / v * 2.0 * s / std::sqrt(1.0 - std::pow(1.0 - s * s, p + 1)) / 20000;
  }
  const auto pulses = impact.take_pulses();
  ASSERT_EQ(pulses.size(), 1U);
  EXPECT_NEAR(static_cast<double>(pulses[0].impulse_n_s.size()) * pulses[0].step_s, time, 3e-3 * time);
}

TEST(Balls, RefusalOfInvalidInput) {
  const Body ball = make_ball(0.01, {0, 0, -1});
  const Contact good = make_contact(0.01);
  const auto refuse = [&](auto change) {
    Body body = ball;
    Contact contact = good;
    change(body, contact);
    EXPECT_THROW(Impact({body}, {contact}), std::invalid_argument);
  };
  refuse([](Body& b, Contact&) { b.mass_kg = -1; });
  refuse([](Body& b, Contact&) { b.velocity_m_s[0] = NAN; });
  refuse([](Body& b, Contact&) { b.q = {1.0}; });
  refuse([](Body&, Contact& c) { c.a = 1; });
  refuse([](Body&, Contact& c) { c.b = 0; });
  refuse([](Body&, Contact& c) { c.normal = {0, 0, 2}; });
  refuse([](Body&, Contact& c) { c.spring.stiffness = 0; });
  refuse([](Body&, Contact& c) { c.restitution = -0.1; });
  refuse([](Body&, Contact& c) { c.gap_m = INFINITY; });
  EXPECT_THROW(Impact({ball}, {}), std::invalid_argument);
  std::vector<double> shape(3, 1.0);
  refuse([&](Body&, Contact& c) { c.shape_a = shape; });
}

}  // namespace
}  // namespace carillon::impact::tests

// Bodies that ring when they meet: against Runge-Kutta, in pieces, with contacts that join.
#include <array>

#include "tests/unit/runtime/physics/impact/scenes.hpp"

namespace carillon::impact::tests {
namespace {

/// Two bodies of three modes each on the axis z, both ringing: as an impact, and as plain equations for Runge-Kutta.
struct Pair {
  std::array<double, 3> omega_a{2e3, 9e3, 4e4}, omega_b{3e3, 1.4e4, 6e4}, decay_a{20, 40, 300}, decay_b{10, 60, 500};
  std::array<double, 3> phi_a{3.0, -2.0, 2.5}, phi_b{1.5, 2.0, -1.0};
  std::array<double, 3> q_a{2e-5, -1e-5, 1e-6}, q_b{1e-5, 2e-6, -1e-6}, v_a{0.1, 0.05, -0.02}, v_b{-0.05, 0.02, 0.03};
  double mass_a = 0.05, mass_b = 0.12, speed = 0.6, stiffness = 4e9;
  Modes modes_a{omega_a, decay_a}, modes_b{omega_b, decay_b};
  std::vector<double> shape_a, shape_b;

  Pair() {
    for (std::size_t i = 0; i < 3; ++i) {
      shape_a.insert(shape_a.end(), {0.3, 0.1, phi_a[i]});
      shape_b.insert(shape_b.end(), {0.2, -0.4, phi_b[i]});
    }
  }
  std::vector<Body> make_bodies() const {
    Body a, b;
    a.mass_kg = mass_a;
    b.mass_kg = mass_b;
    a.velocity_m_s = {0, 0, -speed};
    a.modes = &modes_a;
    b.modes = &modes_b;
    a.q.assign(q_a.begin(), q_a.end());
    b.q.assign(q_b.begin(), q_b.end());
    a.q_dot.assign(v_a.begin(), v_a.end());
    b.q_dot.assign(v_b.begin(), v_b.end());
    return {a, b};
  }
  std::vector<Contact> make_contacts() const {
    Contact contact;
    contact.b = 1;
    contact.normal = {0, 0, 1};
    contact.spring.stiffness = stiffness;
    contact.shape_a = shape_a;
    contact.shape_b = shape_b;
    return {contact};
  }
};

/// State: z_a, v_a, z_b, v_b, then q, v of a's and b's modes, and the work of their damping.
using Vector = std::array<long double, 17>;
Vector calc_rate(const Pair& p, const Vector& s, long double y_0) {
  long double y = y_0 - s[0] + s[2];
  for (std::size_t i = 0; i < 3; ++i) y += -p.phi_a[i] * s[4 + 2 * i] + p.phi_b[i] * s[10 + 2 * i];
  const long double force = y > 0 ? p.stiffness * y * std::sqrt(y) : 0;
  Vector r{};
  r[0] = s[1];
  r[1] = force / p.mass_a;
  r[2] = s[3];
  r[3] = -force / p.mass_b;
  for (std::size_t i = 0; i < 3; ++i) {
    r[4 + 2 * i] = s[5 + 2 * i];
    r[5 + 2 * i] = p.phi_a[i] * force - 2 * p.decay_a[i] * s[5 + 2 * i] - p.omega_a[i] * p.omega_a[i] * s[4 + 2 * i];
    r[10 + 2 * i] = s[11 + 2 * i];
    r[11 + 2 * i] = -p.phi_b[i] * force - 2 * p.decay_b[i] * s[11 + 2 * i] - p.omega_b[i] * p.omega_b[i] * s[10 + 2 * i];
    r[16] += 2 * p.decay_a[i] * s[5 + 2 * i] * s[5 + 2 * i] + 2 * p.decay_b[i] * s[11 + 2 * i] * s[11 + 2 * i];
  }
  return r;
}
Vector integrate(const Pair& p, long double time, int steps) {
  Vector s{};
  s[1] = -p.speed;
  long double y_0 = 0;  // touching as it stands
  for (std::size_t i = 0; i < 3; ++i) {
    s[4 + 2 * i] = p.q_a[i];
    s[5 + 2 * i] = p.v_a[i];
    s[10 + 2 * i] = p.q_b[i];
    s[11 + 2 * i] = p.v_b[i];
    y_0 += p.phi_a[i] * p.q_a[i] - p.phi_b[i] * p.q_b[i];
  }
  const long double h = time / steps;
  const auto add = [](const Vector& x, long double f, const Vector& y) {
    Vector z = x;
    for (std::size_t i = 0; i < z.size(); ++i) z[i] += f * y[i];
    return z;
  };
  for (int i = 0; i < steps; ++i) {
    const Vector k1 = calc_rate(p, s, y_0), k2 = calc_rate(p, add(s, h / 2, k1), y_0), k3 = calc_rate(p, add(s, h / 2, k2), y_0),
                 k4 = calc_rate(p, add(s, h, k3), y_0);
    s = add(add(add(add(s, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4);
  }
  return s;
}

TEST(Ringing, AgreementWithRungeKutta) {
  const Pair pair;
  Impact impact = run(pair.make_bodies(), pair.make_contacts(), {.steps_per_pulse = 400.0});
  const auto after = impact.get_bodies();
  const Vector s = integrate(pair, impact.get_time(), 20000);
  EXPECT_NEAR(after[0].velocity_m_s[2], static_cast<double>(s[1]), 2e-4 * pair.speed);
  EXPECT_NEAR(after[1].velocity_m_s[2], static_cast<double>(s[3]), 2e-4 * pair.speed);
  EXPECT_NEAR(after[0].moved_m[2], static_cast<double>(s[0]), 1e-3 * std::abs(static_cast<double>(s[0])) + 1e-9);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(after[0].q_dot[i], static_cast<double>(s[5 + 2 * i]), 4e-4);
    EXPECT_NEAR(after[1].q_dot[i], static_cast<double>(s[11 + 2 * i]), 4e-4);
  }
  EXPECT_NEAR(impact.get_books().dissipated_modes, static_cast<double>(s[16]), 2e-3 * static_cast<double>(s[16]));
  EXPECT_NEAR(pair.mass_a * after[0].velocity_m_s[2] + pair.mass_b * after[1].velocity_m_s[2], -pair.mass_a * pair.speed, 1e-15);
}

TEST(Ringing, ModalStatesFromForceSamples) {
  // As a synthesiser uses the samples: each is a constant force for one step.
  const Pair pair;
  Impact impact = run(pair.make_bodies(), pair.make_contacts());
  const auto after = impact.get_bodies();
  auto q = pair.make_bodies()[0].q, v = pair.make_bodies()[0].q_dot;
  const auto pulses = impact.take_pulses();
  ASSERT_EQ(pulses.size(), 1U);
  const double h = pulses[0].step_s;
  pair.modes_a.move_freely(q, v, pulses[0].start_s);
  const Propagator p = make_propagator(pair.omega_a, pair.decay_a, h);
  for (const Vec3& j : pulses[0].impulse_n_s)
    for (std::size_t i = 0; i < 3; ++i) {
      const double f = pair.phi_a[i] * j[2] / h, next = p.a[i] * q[i] + p.b[i] * v[i] + p.g[i] * f;
      v[i] = p.c[i] * q[i] + p.e[i] * v[i] + p.b[i] * f;
      q[i] = next;
    }
  pair.modes_a.move_freely(q, v, impact.get_time() - pulses[0].start_s - h * static_cast<double>(pulses[0].impulse_n_s.size()));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(q[i], after[0].q[i], 1e-15);
    EXPECT_NEAR(v[i], after[0].q_dot[i], 1e-12);
  }
}

TEST(Ringing, SameBitsAfterInterruption) {
  const Pair pair;
  std::vector<Contact> contacts = pair.make_contacts();
  contacts[0].friction = 0.3;
  contacts[0].restitution = 0.9;
  std::vector<Body> bodies = pair.make_bodies();
  bodies[0].velocity_m_s[0] = 0.2;
  bodies[0].acceleration_m_s2 = {0, 0, -9.81};
  Impact whole(bodies, contacts), parts(bodies, contacts);
  whole.advance(1.0);
  std::vector<Vec3> samples;
  std::size_t pieces = 0;
  double end = 0.0;
  for (double time = 0.0; !parts.has_ended(); time += 7.3e-6) {
    if (parts.has_ended()) break;
    parts.advance(time);
    EXPECT_TRUE(parts.has_ended() || parts.get_time() >= time);
    EXPECT_LT(parts.get_time(), time + parts.get_step_length());
    for (const Pulse& pulse : parts.take_pulses()) {
      const std::size_t silent = std::llround((pulse.start_s - end) / pulse.step_s);
      if (!samples.empty()) samples.resize(samples.size() + silent);
      samples.insert(samples.end(), pulse.impulse_n_s.begin(), pulse.impulse_n_s.end());
      end = pulse.start_s + pulse.step_s * static_cast<double>(pulse.impulse_n_s.size());
      ++pieces;
    }
  }
  EXPECT_GT(pieces, 3U);
  EXPECT_EQ(whole.get_steps(), parts.get_steps());
  const auto a = whole.get_bodies(), b = parts.get_bodies();
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(a[i].velocity_m_s, b[i].velocity_m_s);
    EXPECT_EQ(a[i].spin_rad_s, b[i].spin_rad_s);
    EXPECT_EQ(a[i].moved_m, b[i].moved_m);
    EXPECT_EQ(a[i].q, b[i].q);
    EXPECT_EQ(a[i].q_dot, b[i].q_dot);
  }
  EXPECT_EQ(whole.get_books().dissipated_friction, parts.get_books().dissipated_friction);
  ASSERT_EQ(whole.take_pulses()[0].impulse_n_s, samples);
}

TEST(Ringing, EnergyBalanceWithJoiningContact) {
  for (const double gap : {1e-7, -1e-7}) {
    const Pair pair;
    std::vector<Contact> contacts = pair.make_contacts();
    Impact impact(pair.make_bodies(), contacts);
    ASSERT_FALSE(impact.advance(2e-5));
    Contact floor;
    floor.a = 1;
    floor.normal = {0, 0, 1};
    floor.gap_m = gap;
    floor.spring.stiffness = 2e9;
    floor.shape_a = pair.shape_b;
    impact.join(floor);
    ASSERT_TRUE(impact.advance(1.0));
    EXPECT_GT(impact.get_impulse(1), 0.0);
    contacts.push_back(floor);
    expect_sound(impact, contacts);
  }
}

TEST(Ringing, JoiningBody) {
  const Pair pair;
  const Body ball = make_ball(0.01, {0, 0, 0.4});
  Contact touch = make_contact(0.005, 1, 2);
  touch.shape_a = pair.shape_b;
  std::vector<Contact> both = pair.make_contacts();
  Impact joined(pair.make_bodies(), both);
  joined.advance(2e-5);
  const int index = joined.join(ball);
  ASSERT_EQ(index, 2);
  joined.join(touch);
  joined.advance(1.0);
  EXPECT_LT(joined.get_bodies()[2].velocity_m_s[2], 0.4);
  both.push_back(touch);
  expect_sound(joined, both);
}

TEST(Ringing, UpdateWithoutChange) {
  const Pair pair;
  std::vector<Contact> contacts = pair.make_contacts();
  contacts[0].friction = 0.3;
  Impact whole(pair.make_bodies(), contacts), updated(pair.make_bodies(), contacts);
  whole.advance(1.0);
  updated.advance(3e-5);
  ASSERT_FALSE(updated.has_ended());
  updated.update(updated.get_bodies(), contacts);
  updated.advance(1.0);
  EXPECT_EQ(whole.get_steps(), updated.get_steps());
  for (std::size_t b = 0; b < 2; ++b)
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(whole.get_bodies()[b].velocity_m_s[i], updated.get_bodies()[b].velocity_m_s[i], 1e-13);
      EXPECT_NEAR(whole.get_bodies()[b].q_dot[i], updated.get_bodies()[b].q_dot[i], 1e-12);
    }
}

TEST(Ringing, EnergyBalanceOfRotatingBodies) {
  // A plate pressed on one corner for 4 ms while it spins, with its frame updated every 0.2 ms.
  const Plate plate = make_plate(0.3, 0.2, 0.002, 20e3, 0.29, 0.19);
  const Modes modes(plate.omega, plate.decay, 2.0 * kPi * 20e3);
  Body body;
  body.mass_kg = 0.94;
  const auto make_inertia = [](double angle) {  // about z
    const double c = std::cos(angle), s = std::sin(angle), x = 3.1e-3, y = 7.1e-3;
    return Mat3{{{x * c * c + y * s * s, (x - y) * c * s, 0}, {(x - y) * c * s, x * s * s + y * c * c, 0}, {0, 0, x + y}}};
  };
  body.inertia_kg_m2 = make_inertia(0.0);
  body.velocity_m_s = {0.1, 0, -0.5};
  body.spin_rad_s = {2.0, -1.0, 20.0};
  body.acceleration_m_s2 = {0, 0, -9.81};
  body.modes = &modes;
  std::vector<Contact> contacts{make_contact(0.001)};
  contacts[0].where_m = {0.14, 0.09, 0};
  contacts[0].friction = 0.4;
  contacts[0].spring.stiffness = 1e6;
  contacts[0].shape_a = plate.shape;
  Impact impact({body}, contacts, {.part_s = 1.0});
  double angle = 0.0;
  for (int piece = 1; piece <= 20; ++piece) {
    impact.advance(2e-4 * piece);
    Body now = impact.get_bodies()[0];
    impact.take_pulses();  // their cone is about the normal of then
    angle += now.turned_rad[2];
    now.centre_m = now.centre_m + now.moved_m;
    now.inertia_kg_m2 = make_inertia(angle);
    contacts[0].where_m =
        now.centre_m + Vec3{0.14 * std::cos(angle) - 0.09 * std::sin(angle), 0.14 * std::sin(angle) + 0.09 * std::cos(angle), 0};
    contacts[0].normal = {std::sin(1e-3 * piece), 0, std::cos(1e-3 * piece)};
    impact.update(std::vector{now}, contacts);
  }
  EXPECT_GT(angle, 0.01);
  expect_sound(impact, contacts);
  std::vector<Contact> two(2, contacts[0]);
  EXPECT_THROW(impact.update(impact.get_bodies(), two), std::invalid_argument);
}

TEST(Ringing, SecondHitInBothPhases) {
  // The same hit on a body that rings in one phase and in the other: books close, and the modes end with more or with less.
  const Modes modes(std::array{2.0 * kPi * 500.0}, std::array{0.0});
  const std::vector<double> shape{0, 0, 2.0};
  std::array<double, 2> modal{};
  for (const int sign : {-1, 1}) {
    Body ball = make_ball(0.01, {0, 0, -1.0}), plate;
    plate.modes = &modes;
    plate.q = {0.0};
    plate.q_dot = {0.2 * sign};
    std::vector<Contact> contacts{make_contact(0.01, 0, 1)};
    contacts[0].shape_b = shape;
    const Books books = run({ball, plate}, contacts).get_books();
    EXPECT_NEAR(books.dissipated_modes, 0.0, 1e-14 * books.start);
    modal[sign > 0 ? 1 : 0] = books.modal;
  }
  EXPECT_GT(modal[0], 0.02);  // 0.02 J were in it
  EXPECT_LT(modal[1], 0.02);
}

TEST(Ringing, ClosingSpeedOfOpenContact) {
  // From 0.05 m/s to 0.29 m/s on the way of 40 um; the same from there on.
  const double pull = 1e3, way = 4e-5, speed = std::sqrt(0.05 * 0.05 + 2.0 * pull * way);
  double rebound[2] = {};
  for (const int begins_open : {0, 1}) {
    Body ball = make_ball(0.01, {0, 0, begins_open ? -0.05 : -speed});
    ball.acceleration_m_s2 = {0, 0, -pull};
    std::vector<Contact> contacts{make_contact(0.01)};
    contacts[0].restitution = 0.5;
    contacts[0].gap_m = begins_open ? way : 0.0;
    Impact impact({ball}, contacts, {.steps_per_pulse = 60});
    double fastest = 0.0;
    for (int n = 0; n < 200; ++n) {
      impact.advance(1e-5 * n);
      fastest = std::max(fastest, impact.get_bodies()[0].velocity_m_s[2]);
    }
    rebound[begins_open] = fastest / speed;
    expect_sound(impact, contacts);
  }
  EXPECT_GT(rebound[0], 0.3);
  EXPECT_NEAR(rebound[1], rebound[0], 0.02);
}

TEST(Ringing, UpdateOfOpenAndPressedContacts) {
  Body ball = make_ball(0.01, {0, 0, -1.0});
  std::vector<Contact> contacts(2, make_contact(0.01));
  contacts[1].gap_m = 1e-3;
  Impact impact({ball}, contacts);
  EXPECT_FALSE(impact.advance(1e-5));
  const double pressed = impact.get_compression(0);
  EXPECT_GT(pressed, 0.0);
  EXPECT_LT(impact.get_compression(1), 0.0);
  contacts[0].gap_m = contacts[1].gap_m = 2e-4;
  impact.update(impact.get_bodies(), contacts);
  EXPECT_EQ(impact.get_compression(0), pressed);
  EXPECT_EQ(impact.get_compression(1), -2e-4);
}

TEST(Ringing, ExchangeByStifferSpring) {
  for (const double factor : {1.0, 30.0}) {
    std::vector<Contact> contacts{make_contact(0.01)};
    contacts[0].restitution = 1.0;
    Impact impact({make_ball(0.01, {0, 0, -1.0})}, contacts);
    EXPECT_FALSE(impact.advance(1e-5));
    const double depth_m = impact.calc_depth(0), compression_m = impact.get_compression(0);
    const double spring_j = impact.get_books().spring;
    contacts[0].spring = {.stiffness = factor * contacts[0].spring.stiffness * std::sqrt(compression_m), .exponent = 1.0};
    impact.update(impact.get_bodies(), contacts);
    EXPECT_NEAR(impact.calc_depth(0), depth_m, 1e-12 * depth_m);
    EXPECT_NEAR(impact.get_compression(0), compression_m * std::sqrt(0.8 / factor), 1e-9 * compression_m);  // 2/5 y F = y' F' / 2
    EXPECT_NEAR(impact.get_books().spring, spring_j, 1e-12 * spring_j);
    contacts[0].spring.stiffness *= 0.1;  // a softer one is not taken while it presses
    impact.update(impact.get_bodies(), contacts);
    EXPECT_NEAR(impact.get_books().spring, spring_j, 1e-12 * spring_j);
    impact.advance(1.0);
    EXPECT_NEAR(impact.get_bodies()[0].velocity_m_s[2], 1.0, 1e-6);
    EXPECT_NEAR(impact.get_books().calc_error(), 0.0, 1e-12);
  }
}

TEST(Ringing, RecoveryOfYieldedCompression) {
  for (const double speed : {-1.0, 1.0}) {
    std::vector<Contact> contacts{make_contact(0.01)};
    contacts[0].yielded_m = 1e-4;
    Impact impact({make_ball(0.01, {0, 0, speed})}, contacts);
    EXPECT_EQ(impact.calc_depth(0), 1e-4);
    impact.advance(2e-5);
    EXPECT_NEAR(impact.calc_depth(0), 1e-4 - impact.get_bodies()[0].moved_m[2], 1e-12);
    EXPECT_EQ(impact.get_compression(0) > 0.0, speed < 0.0);  // pressed again, it pushes at once
    if (speed < 0.0) continue;
    impact.advance(1.0);
    EXPECT_TRUE(impact.has_ended());
    EXPECT_EQ(impact.calc_depth(0), 0.0);
    EXPECT_EQ(impact.get_impulse(0), 0.0);
  }
}

}  // namespace
}  // namespace carillon::impact::tests

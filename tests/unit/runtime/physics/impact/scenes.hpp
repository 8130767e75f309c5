// Balls and plates for the tests of impacts, and the invariants of all impacts.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "runtime/physics/impact/impact.hpp"

namespace carillon::impact::tests {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kYoung = 210e9, kPoisson = 0.3, kDensity = 7850.0;  // steel

inline Body make_ball(double radius_m, const Vec3& velocity_m_s, double density = kDensity) {
  Body ball;
  ball.mass_kg = density * 4.0 / 3.0 * kPi * radius_m * radius_m * radius_m;
  const double inertia = 0.4 * ball.mass_kg * radius_m * radius_m;
  ball.inertia_kg_m2 = {{{inertia, 0, 0}, {0, inertia, 0}, {0, 0, inertia}}};
  ball.centre_m = {0, 0, radius_m};
  ball.velocity_m_s = velocity_m_s;
  return ball;
}

/// Ball (body `a`) on a body under it at z = 0.
inline Contact make_contact(double radius_m, int a = 0, int b = -1) {
  Contact contact;
  contact.a = a;
  contact.b = b;
  contact.normal = {0, 0, 1};
  contact.spring.stiffness = calc_hertz_stiffness(kYoung, kPoisson, kYoung, kPoisson, radius_m);
  return contact;
}

/// Modes of a simply supported rectangular plate (Kirchhoff), in closed form, and their shapes at one point.
struct Plate {
  std::vector<double> omega, decay, shape;
  double impedance = 0.0;  // of the infinite plate, 8 sqrt(D rho h)
};
inline Plate make_plate(double a, double b, double thickness, double highest_hz, double x, double y, double decay = 1.0) {
  const double D = kYoung * std::pow(thickness, 3) / 12.0 / (1.0 - kPoisson * kPoisson), area_mass = kDensity * thickness;
  Plate plate;
  plate.impedance = 8.0 * std::sqrt(D * area_mass);
  for (int i = 1; i < 400; ++i)
    for (int j = 1; j < 400; ++j) {
      const double omega = kPi * kPi * (i * i / (a * a) + j * j / (b * b)) * std::sqrt(D / area_mass);
      if (omega > 2.0 * kPi * highest_hz) break;
      plate.omega.push_back(omega);
      plate.decay.push_back(decay);
      const double phi = 2.0 / std::sqrt(area_mass * a * b) * std::sin(i * kPi * x / a) * std::sin(j * kPi * y / b);
      plate.shape.insert(plate.shape.end(), {0.0, 0.0, phi});
    }
  return plate;
}

/// Books close to 1e-10, nothing negative is dissipated, no number has run away, and no force pulls or leaves its cone.
inline void expect_sound(Impact& impact, const std::vector<Contact>& contacts) {
  const Books books = impact.get_books();
  const double scale = std::max({books.start, std::abs(books.given), books.rigid});
  EXPECT_LE(std::abs(books.calc_error()), 1e-10);
  EXPECT_EQ(impact.get_misses(), 0);
  EXPECT_GE(books.dissipated_modes, -1e-10 * scale);
  EXPECT_GE(books.dissipated_contact, -1e-10 * scale);
  EXPECT_GE(books.yielded, -1e-10 * scale);
  EXPECT_GE(books.dissipated_friction, -1e-10 * scale);
  EXPECT_GE(books.above_band, -1e-10 * scale);
  for (const Body& body : impact.get_bodies()) {
    EXPECT_TRUE(std::isfinite(dot(body.velocity_m_s, body.velocity_m_s) + dot(body.spin_rad_s, body.spin_rad_s)));
    for (std::size_t i = 0; i < body.q.size(); ++i) ASSERT_TRUE(std::isfinite(body.q[i] + body.q_dot[i]));
  }
  for (const Pulse& pulse : impact.take_pulses()) {
    const Contact& contact = contacts[pulse.contact];
    for (const Vec3& j : pulse.impulse_n_s) {
      const double normal = dot(j, contact.normal);
      const Vec3 tangential = j - normal * contact.normal;
      EXPECT_GE(normal, 0.0);
      EXPECT_LE(std::sqrt(dot(tangential, tangential)), contact.friction * normal * (1.0 + 1e-12) + 1e-14 * normal);
    }
  }
}

inline Impact run(const std::vector<Body>& bodies, const std::vector<Contact>& contacts, const Options& options = {}) {
  Impact impact(bodies, contacts, options);
  EXPECT_TRUE(impact.advance(10.0));
  Impact copy = impact;  // expect_sound takes the pulses
  expect_sound(copy, contacts);
  return impact;
}

}  // namespace carillon::impact::tests

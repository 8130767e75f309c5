// Hard cases of one impact: masses, speeds, modes and laws at their ends. The books have to close, no number may run away, and the answer
// is known where the part says so.
#include <array>
#include <cstdint>
#include <string>

#include "tests/hard/figure.hpp"
#include "tests/unit/runtime/physics/impact/scenes.hpp"

namespace carillon::hard {
namespace {

using impact::Body;
using impact::Books;
using impact::Contact;
using impact::Impact;
using impact::Modes;
using impact::Options;
using impact::Pulse;
using impact::tests::make_ball;
using impact::tests::make_contact;
using impact::tests::make_plate;
constexpr double kBooks = 1e-10;

/// Largest fault: an open energy balance, energy gained by a loss, forces that pull or leave the cone, diverging numbers.
double calc_fault(Impact& impact, const std::vector<Contact>& contacts) {
  const Books books = impact.get_books();
  const double scale = std::max({books.start, std::abs(books.given), books.rigid, 1e-300});
  double fault = std::abs(books.calc_error());
  for (const double loss : {books.dissipated_modes, books.dissipated_contact, books.yielded, books.dissipated_friction, books.above_band})
    fault = std::max(fault, -loss / scale);
  for (const Body& body : impact.get_bodies()) {
    double sum = dot(body.velocity_m_s, body.velocity_m_s) + dot(body.spin_rad_s, body.spin_rad_s) + dot(body.moved_m, body.moved_m);
    for (std::size_t i = 0; i < body.q.size(); ++i) sum += body.q[i] + body.q_dot[i];
    if (!std::isfinite(sum)) return sum;
  }
  for (const Pulse& pulse : impact.take_pulses()) {
    const Contact& contact = contacts[pulse.contact];
    for (const Vec3& j : pulse.impulse_n_s) {
      const double normal = dot(j, contact.normal);
      const Vec3 rest = j - normal * contact.normal;
      if (normal < 0.0 || std::sqrt(dot(rest, rest)) > contact.friction * normal * (1.0 + 1e-12) + 1e-13 * normal)
        fault = std::max(fault, 1.0);
    }
  }
  return fault;
}

/// Runs it to its end, or for `longest_s`, and holds its fault to the bound.
Impact hold_impact(const std::string& id, const std::vector<Body>& bodies, const std::vector<Contact>& contacts, const std::string& part,
                   const Options& options = {}, double longest_s = 0.2) {
  Impact impact(bodies, contacts, options);
  impact.advance(longest_s);
  Impact copy = impact;
  hold(id, calc_fault(copy, contacts), kBooks, part);
  hold(id, impact.get_misses(), 0.0, part + ", steps without the law");
  return impact;
}

/// Balls in a column along z, one radius for all contacts; the last one lies on the ground.
std::vector<Contact> make_column(std::vector<Body>& bodies, double friction) {
  std::vector<Contact> contacts;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    bodies[i].centre_m = {0, 0, 0.02 * static_cast<double>(bodies.size() - i) - 0.01};
    contacts.push_back(make_contact(0.005, static_cast<int>(i), i + 1 < bodies.size() ? static_cast<int>(i) + 1 : -1));
    contacts.back().where_m = {0, 0, bodies[i].centre_m[2] - 0.01};
    contacts.back().friction = friction;
  }
  return contacts;
}

TEST(time, impact_masses) {
  for (const double ratio : {1e-6, 1e-3, 1.0, 1e3, 1e6})
    for (const double friction : {0.0, 0.3}) {
      std::vector<Body> bodies{make_ball(0.01, {0.1, 0, -1.0}), make_ball(0.01, {}, 7850.0 * ratio), make_ball(0.01, {})};
      for (Body& body : bodies) body.acceleration_m_s2 = {0, 0, -9.81};
      const auto contacts = make_column(bodies, friction);
      hold_impact("impact_masses", bodies, contacts,
                  "middle of three " + to_json(ratio) + " times as heavy, friction " + to_json(friction));
      // Two alone, head on: speeds of the elastic impact.
      std::vector<Body> two{make_ball(0.01, {0, 0, -1.0}), make_ball(0.01, {}, 7850.0 * ratio)};
      auto one = make_column(two, friction);
      one.resize(1);
      const auto after = hold_impact("impact_masses", two, one, "two alone, " + to_json(ratio)).get_bodies();
      hold("impact_masses", std::abs(after[0].velocity_m_s[2] - (ratio - 1.0) / (ratio + 1.0)), kBooks, "speed after, " + to_json(ratio));
    }
}

TEST(time, impact_speeds) {
  const auto plate = make_plate(0.3, 0.2, 0.002, 20e3, 0.13, 0.07);
  const Modes modes(plate.omega, plate.decay, 2.0 * impact::tests::kPi * 20e3);
  for (const double speed : {1e-8, 1e-5, 1e-3, 1.0, 100.0})
    for (const double gravity : {0.0, 9.81}) {
      Body ball = make_ball(0.01, {0.5 * speed, 0, -speed}), below;
      ball.acceleration_m_s2 = {0, 0, -gravity};
      below.modes = &modes;
      std::vector<Contact> contacts{make_contact(0.01, 0, 1)};
      contacts[0].shape_b = plate.shape;
      contacts[0].friction = 0.2;
      contacts[0].restitution = 0.7;
      hold_impact("impact_speeds", {ball, below}, contacts, to_json(speed) + " m/s, gravity " + to_json(gravity), {}, 0.02);
    }
}

TEST(time, impact_modes) {
  for (const int count : {0, 1, 7, 8, 9, 1000})
    for (const double highest : {10.0, 1e5, 1e9})         // far below and far above the step
      for (const double damping : {0.0, 0.01, 1.0, 1e3})  // over critical
        for (const double weight : {1e-6, 1.0, 100.0}) {
          std::vector<double> omega, decay, shape;
          for (int i = 0; i < count; ++i) {
            omega.push_back(highest * (i + 1.0) / count);
            decay.push_back(damping * omega.back());
            shape.insert(shape.end(), {0.1 * weight, 0.0, weight * (i % 2 ? 1.0 : -0.7)});
          }
          const Modes modes(omega, decay, 1e5);
          Body ball = make_ball(0.01, {0.2, 0, -1.0}), below;
          ball.modes = below.modes = &modes;
          std::vector<Contact> contacts{make_contact(0.01, 0, 1)};
          contacts[0].shape_a = contacts[0].shape_b = shape;
          contacts[0].friction = 0.3;
          hold_impact("impact_modes", {ball, below}, contacts,
                      std::to_string(count) + " modes up to " + to_json(highest) + " rad/s, damping " + to_json(damping) + ", shapes " +
                          to_json(weight),
                      {}, 1e-3);
        }
}

TEST(time, impact_points) {
  // More points than the motion of a rigid body determines, on a body that turns, slips and rings.
  const auto plate = make_plate(0.3, 0.2, 0.002, 20e3, 0.13, 0.07);
  const Modes modes(plate.omega, plate.decay, 2.0 * impact::tests::kPi * 20e3);
  for (const double friction : {0.0, 0.1, 1.0, 1e3})
    for (const double restitution : {0.0, 0.5, 1.0})
      for (const bool rings : {false, true}) {
        Body box;
        box.mass_kg = 0.5;
        box.inertia_kg_m2 = {{{1e-3, 2e-4, 0}, {2e-4, 8e-4, 1e-4}, {0, 1e-4, 1.2e-3}}};
        box.centre_m = {0.003, -0.002, 0.05};
        box.velocity_m_s = {1.0, -0.4, -2.0};
        box.spin_rad_s = {3.0, -7.0, 20.0};
        box.acceleration_m_s2 = {0, 0, -9.81};
        if (rings) box.modes = &modes;
        std::vector<Contact> contacts;
        for (int i = 0; i < 8; ++i) {
          contacts.push_back(make_contact(1e-3));
          contacts.back().where_m = {0.05 * std::cos(0.8 * i), 0.05 * std::sin(0.8 * i), 0.0};
          contacts.back().friction = friction;
          contacts.back().restitution = restitution;
          contacts.back().gap_m = i % 2 ? 0.0 : 1e-6;
          if (rings) contacts.back().shape_a = plate.shape;
        }
        hold_impact("impact_points", {box}, contacts,
                    "friction " + to_json(friction) + ", restitution " + to_json(restitution) + (rings ? ", rings" : ""), {}, 3e-3);
      }
}

TEST(time, impact_coarse) {
  // Steps far too long: the energy balance still closes, and a ball on a plate never comes back faster than it went.
  const auto plate = make_plate(0.5, 0.4, 0.002, 20e3, 0.2, 0.17);
  for (const double steps : {1.0, 1.5, 2.0, 3.0, 5.0})
    for (const double law : {1.0, 1.5, 3.5}) {
      const Modes modes(plate.omega, plate.decay, 100.0);  // an edge of the band that does not shorten the step
      Body ball = make_ball(0.01, {0, 0, -1.0}), below;
      below.modes = &modes;
      std::vector<Contact> contacts{make_contact(0.01, 0, 1)};
      contacts[0].shape_b = plate.shape;
      contacts[0].spring = {law == 1.5 ? contacts[0].spring.stiffness : law < 1.5 ? 1e7 : 1e17, law, 0.0};
      const Impact done = hold_impact("impact_coarse", {ball, below}, contacts, to_json(steps) + " steps a pulse, exponent " + to_json(law),
                                      {.steps_per_pulse = steps});
      hold("impact_coarse", done.get_bodies()[0].velocity_m_s[2] - 1.0, kBooks, "speed gained, " + to_json(steps));
    }
}

TEST(time, impact_pieces) {
  // A plate that is pushed for 20 ms, left and taken up again at every step: the bits of one go.
  const auto plate = make_plate(0.3, 0.3, 0.001, 5e3, 0.14, 0.12);
  const Modes modes(plate.omega, plate.decay);
  Body ball = make_ball(0.02, {0.1, 0, -0.5}), below;
  ball.acceleration_m_s2 = {0, 0, -9.81};
  below.modes = &modes;
  std::vector<Contact> contacts{make_contact(0.02, 0, 1)};
  contacts[0].shape_b = plate.shape;
  contacts[0].friction = 0.3;
  Impact whole = hold_impact("impact_pieces", {ball, below}, contacts, "books", {.part_s = 5e-3}, 0.02);
  Impact pieces({ball, below}, contacts, {.part_s = 5e-3});
  while (pieces.get_steps() < whole.get_steps()) pieces.advance(pieces.get_time() + 1e-9);
  const auto a = whole.get_bodies(), b = pieces.get_bodies();
  const bool equal =
      a[0].velocity_m_s == b[0].velocity_m_s && a[0].spin_rad_s == b[0].spin_rad_s && a[1].q == b[1].q && a[1].q_dot == b[1].q_dot;
  hold("impact_pieces", equal ? 0.0 : 1.0, kBooks, "bits");
}

TEST(time, impact_needle) {
  // Hardly any inertia about one axis, struck at its tip and slipping; and one that is a point.
  for (const double thin : {1e-3, 1e-6, 1e-9, 0.0})
    for (const double friction : {0.0, 0.5}) {
      Body needle;
      needle.mass_kg = 1e-4;
      const double across = 1e-4 * 0.05 * 0.05 / 12.0;
      needle.inertia_kg_m2 = {{{across, 0, 0}, {0, across, 0}, {0, 0, thin * across}}};
      needle.centre_m = {0.01, 0.002, 0.02};
      needle.velocity_m_s = {0, 0.3, -5.0};
      needle.spin_rad_s = {10.0, -20.0, 3000.0};
      std::vector<Contact> contacts{make_contact(1e-5)};
      contacts[0].friction = friction;
      hold_impact("impact_needle", {needle}, contacts, "inertia " + to_json(thin) + ", friction " + to_json(friction));
    }
}

/// Numbers from 0 to 1, the same everywhere.
struct Chance {
  std::uint64_t state = 1;
  double draw() {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state >> 11) / 9007199254740992.0;
  }
  double draw(double low, double high) { return low + (high - low) * draw(); }
  double draw_decades(double low, double high) { return low * std::pow(high / low, draw()); }
  Vec3 draw_vector(double size) { return {draw(-size, size), draw(-size, size), draw(-size, size)}; }
  Vec3 draw_direction() {
    for (;;) {
      const Vec3 v = draw_vector(1.0);
      if (dot(v, v) > 0.1 && dot(v, v) < 1.0) return 1.0 / std::sqrt(dot(v, v)) * v;
    }
  }
};

TEST(time, impact_random) {
  // Up to four bodies and eight contacts, everything drawn: places, laws, masses over six decades, modes that ring.
  Chance chance;
  for (int round = 0; round < 400; ++round) {
    std::vector<Modes> modes;
    std::vector<Body> bodies(1 + static_cast<std::size_t>(4.0 * chance.draw()));
    modes.reserve(bodies.size());
    for (Body& body : bodies) {
      body.mass_kg = chance.draw_decades(1e-3, 1e3);
      const double size = 0.1 * std::cbrt(body.mass_kg), i = 0.1 * body.mass_kg * size * size;
      body.inertia_kg_m2 = {{{i * chance.draw(1, 3), 0, 0}, {0, i * chance.draw(1, 3), 0}, {0, 0, 2 * i}}};
      body.centre_m = chance.draw_vector(size);
      body.velocity_m_s = chance.draw_vector(chance.draw_decades(1e-3, 10.0));
      body.spin_rad_s = chance.draw_vector(chance.draw_decades(0.1, 100.0));
      body.acceleration_m_s2 = {0, 0, -9.81};
      std::vector<double> omega, decay;
      for (int m = static_cast<int>(30.0 * chance.draw()); m > 0; --m) {
        omega.push_back(chance.draw_decades(100.0, 1e5));
        decay.push_back(chance.draw_decades(1e-4, 2.0) * omega.back());
      }
      modes.emplace_back(omega, decay);
      body.modes = &modes.back();
      for (std::size_t m = 0; m < omega.size(); ++m) {
        body.q.push_back(chance.draw(-1e-6, 1e-6));
        body.q_dot.push_back(chance.draw(-1e-2, 1e-2));
      }
    }
    std::vector<std::vector<double>> shapes;
    std::vector<Contact> contacts;
    for (int c = 1 + static_cast<int>(8.0 * chance.draw()); c > 0; --c) {
      Contact contact = make_contact(chance.draw_decades(1e-4, 1e-1));
      contact.a = static_cast<int>(chance.draw() * static_cast<double>(bodies.size()));
      contact.b = static_cast<int>(chance.draw() * static_cast<double>(bodies.size() + 1)) - 1;
      if (contact.b == contact.a) contact.b = -1;
      contact.where_m = chance.draw_vector(0.1);
      contact.normal = chance.draw_direction();
      contact.gap_m = chance.draw(-1e-6, 1e-5);
      contact.friction = chance.draw() < 0.3 ? 0.0 : chance.draw_decades(0.01, 3.0);
      contact.restitution = chance.draw();
      contact.spring.exponent = chance.draw() < 0.7 ? 1.5 : chance.draw(1.0, 3.0);
      for (const int body : {contact.a, contact.b}) {
        shapes.emplace_back();
        if (body < 0) continue;
        for (std::size_t m = 0; m < 3 * bodies[body].q.size(); ++m)
          shapes.back().push_back(chance.draw(-2.0, 2.0) / std::sqrt(bodies[body].mass_kg));
      }
      contacts.push_back(contact);
    }
    for (std::size_t c = 0; c < contacts.size(); ++c) {
      contacts[c].shape_a = shapes[2 * c];
      contacts[c].shape_b = shapes[2 * c + 1];
    }
    hold_impact("impact_random", bodies, contacts, "draw " + std::to_string(round), {}, 1e-3);
  }
}

}  // namespace
}  // namespace carillon::hard

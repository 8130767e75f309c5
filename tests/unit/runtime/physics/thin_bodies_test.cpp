// Struck and falling thin plates in a whole world: restitution against Zener's theory, energy of their modes.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <variant>
#include <vector>

#include "runtime/physics/impact/predict.hpp"
#include "tests/unit/runtime/physics/checks.hpp"
#include "tests/unit/runtime/physics/geometry/solids.hpp"
#include "tests/unit/runtime/physics/impact/zener.hpp"
#include "tests/unit/runtime/physics/plate_bank.hpp"

namespace carillon::physics::tests {
namespace {

constexpr double kSteel = 210e9, kSteelPoisson = 0.3, kSteelDensity = 7850.0;

bank::Bank make_steel_ball(double radius_m) {
  const geometry::tests::Solid facets = geometry::tests::make_ball(radius_m, 16);
  bank::Bank ball;
  ball.vertices_m.assign(facets.vertices.begin(), facets.vertices.end());
  ball.triangles.assign(facets.triangles.begin(), facets.triangles.end());
  ball.material = {kSteel, kSteelPoisson, kSteelDensity, 1e-7, 1.0};
  const double mass = kSteelDensity * 4.0 / 3.0 * M_PI * std::pow(radius_m, 3), inertia = 0.4 * mass * radius_m * radius_m;
  ball.rigid = {mass, {0, 0, 0}, {inertia, 0, 0, 0, inertia, 0, 0, 0, inertia}, mass / kSteelDensity};
  return ball;
}

/// A box with one more vertex, the last, at (x, y) of its upper face: hits there find the mode shapes of that vertex.
bank::Bank make_struck_box(const Vec3& size, double x, double y) {
  bank::Bank box = make_box(size);
  box.material = {kSteel, kSteelPoisson, kSteelDensity, 1e-7, 1.0};
  const auto at = static_cast<std::int32_t>(box.vertices_m.size());
  box.vertices_m.push_back({x, y, 0.5 * size[2]});
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::vector<std::array<std::int32_t, 2>> edges;  // of the upper face, without the diagonal
  const auto is_up = [&](const auto& t) {
    return box.vertices_m[t[0]][2] > 0 && box.vertices_m[t[1]][2] > 0 && box.vertices_m[t[2]][2] > 0;
  };
  for (const auto& t : box.triangles) {
    if (!is_up(t)) {
      triangles.push_back(t);
      continue;
    }
    for (int k = 0; k < 3; ++k) {
      const auto &p = box.vertices_m[t[k]], &q = box.vertices_m[t[(k + 1) % 3]];
      if (p[0] == q[0] || p[1] == q[1]) triangles.push_back({t[k], t[(k + 1) % 3], at});
    }
  }
  box.triangles = triangles;
  set_rigid_of_solid(box);
  return box;
}

/// Modes that move along z, and only at the last vertex.
void add_modes(bank::Bank& bank, const std::vector<double>& omega, const std::vector<double>& shape, double decay) {
  for (std::size_t i = 0; i < omega.size(); ++i) {
    bank.eigenvalue_rad2_s2.push_back(omega[i] * omega[i]);
    bank.decay_per_s.push_back(decay);
    bank.residual.push_back(1e-10);
    bank.radiation_gain.push_back(1.0);
    bank.shape_scale.push_back(std::abs(shape[i]) / 32767.0);
  }
  bank.shape.assign(bank.vertices_m.size() * omega.size() * 3, 0);
  for (std::size_t i = 0; i < omega.size(); ++i)
    bank.shape[((bank.vertices_m.size() - 1) * omega.size() + i) * 3 + 2] = shape[i] < 0.0 ? -32767 : 32767;
}

struct Blow {
  double restitution = 0.0;
  int forces = 0;
  std::vector<Impulse> impulses;
  EnergyAudit energy;
};

/// A ball meets the last vertex of a fixed body at a speed. The restitution is that of both.
Blow strike(const bank::Bank& ball, double radius_m, const bank::Bank& struck, double speed_m_s, double restitution = 1.0) {
  WorldSpec spec;
  spec.gravity_m_s2 = {};
  BodySpec a, b;
  a.name = "ball", b.name = "struck";
  a.bank = &ball, b.bank = &struck;
  a.restitution = b.restitution = restitution;
  a.friction = b.friction = 0.0;
  a.initial.position_m = struck.vertices_m.back();
  a.initial.position_m[2] += 1.02 * radius_m;
  a.velocity_m_s = {0, 0, -speed_m_s};
  b.fixed = true;
  spec.bodies = {a, b};
  const double end_s = 0.1 * radius_m / speed_m_s + 0.02;
  World world(spec, {.end_s = end_s, .audits_energy = true});
  Blow blow;
  world.advance(end_s, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
    if (const auto* m = std::get_if<events::BodyMotion>(&e); m != nullptr && m->body == 0)
      blow.restitution = m->velocity_m_s[2] / speed_m_s;
    if (std::holds_alternative<events::Force>(e)) ++blow.forces;
    if (const auto* i = std::get_if<Impulse>(&e); i != nullptr && i->body == 0) blow.impulses.push_back(*i);
  });
  blow.energy = world.get_statistics().energy;
  return blow;
}

struct Case {
  double thickness_m, radius_m, speed_m_s;
};

class LargePlate : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Zener, LargePlate,
                         testing::Values(Case{.006, .005, 1}, Case{.003, .005, 1}, Case{.006, .010, 1}, Case{.006, .015, 1},
                                         Case{.003, .010, 1}, Case{.006, .020, 1}, Case{.003, .0075, 5}, Case{.006, .010, 5},
                                         Case{.003, .0075, 1}, Case{.006, .005, .1}, Case{.003, .010, .1}, Case{.006, .015, 5}));

TEST_P(LargePlate, ZenersRestitution) {
  // A simply supported steel plate of 1 x 0.93 m, its modes to 20 kHz. The shortest pulses have 0.6 cycles of the highest mode.
  const Case c = GetParam();
  const impact::tests::Plate plate = impact::tests::make_plate(1.0, 0.93, c.thickness_m, 20e3, 0.47, 0.4929);
  bank::Bank struck = make_struck_box({1.0, 0.93, c.thickness_m}, 0.47 - 0.5, 0.4929 - 0.465);
  std::vector<double> shape;
  for (std::size_t i = 0; i < plate.omega.size(); ++i) shape.push_back(plate.shape[3 * i + 2]);
  add_modes(struck, plate.omega, shape, 1.0);
  const bank::Bank ball = make_steel_ball(c.radius_m);
  const double stiffness =
      4.0 / 3.0 * std::sqrt(c.radius_m) * 0.5 * kSteel / (1.0 - kSteelPoisson * kSteelPoisson);  // Hertz, equal materials
  const double T = std::pow(ball.rigid.mass_kg / (stiffness * std::sqrt(c.speed_m_s)), 0.4);
  const double wanted = impact::tests::calc_zener(ball.rigid.mass_kg / (plate.impedance * T));
  const Blow blow = strike(ball, c.radius_m, struck, c.speed_m_s);
  EXPECT_NEAR(blow.restitution, wanted, std::max(0.03 * wanted, 0.003));
  EXPECT_GT(blow.forces, 0);
  EXPECT_LT(blow.energy.modes_share, 1.0);
  EXPECT_LT(blow.energy.error_j, 1e-6 * blow.energy.start_j);
}

TEST(Rebound, RestitutionLimitOnBendingBodies) {
  // Small supported plates, which swing back while a heavy ball still presses: with a restitution of 1 it comes off faster than with any
  // given below.
  int thrown = 0;
  for (const double thickness : {0.003, 0.008})
    for (const double radius : {0.005, 0.015, 0.03}) {
      const impact::tests::Plate plate = impact::tests::make_plate(0.2, 0.18, thickness, 15e3, 0.094, 0.0954);
      bank::Bank struck = make_struck_box({0.2, 0.18, thickness}, 0.094 - 0.1, 0.0954 - 0.09);
      std::vector<double> shape;
      for (std::size_t i = 0; i < plate.omega.size(); ++i) shape.push_back(plate.shape[3 * i + 2]);
      add_modes(struck, plate.omega, shape, 1.0);
      const bank::Bank ball = make_steel_ball(radius);
      const double free = strike(ball, radius, struck, 1.0).restitution;
      for (const double e : {0.1, 0.4, 0.7}) {
        const Blow blow = strike(ball, radius, struck, 1.0, e);
        EXPECT_LE(blow.restitution, e * (1.0 + 1e-6)) << thickness << " " << radius;
        EXPECT_LT(blow.energy.error_j, 1e-6 * blow.energy.start_j);
        thrown += free > 1.1 * e ? 1 : 0;
      }
    }
  EXPECT_GT(thrown, 5);
}

TEST(ThickBlock, HertzPulse) {
  // A block of 0.4 x 0.35 x 0.3 m with standing waves of its three directions to 20 kHz; a ball of 2 cm is over it before they answer.
  const Vec3 size{0.4, 0.35, 0.3};
  bank::Bank block = make_struck_box(size, 0.03, -0.02);
  const double speed_of_sound = std::sqrt(kSteel / kSteelDensity);
  std::vector<double> omega, shape;
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j)
      for (int k = 1; k < 8; ++k) {
        const double w = M_PI * speed_of_sound * std::hypot(i / size[0], j / size[1], k / size[2]);
        if (w > 2.0 * M_PI * 20e3) continue;
        const double factor = (i > 0 ? 2.0 : 1.0) * (j > 0 ? 2.0 : 1.0) * 2.0;
        omega.push_back(w);
        shape.push_back(std::sqrt(factor / block.rigid.mass_kg) * std::cos(i * M_PI * (0.5 + 0.03 / size[0])) *
                        std::cos(j * M_PI * (0.5 - 0.02 / size[1])));
      }
  add_modes(block, omega, shape, 10.0);
  for (const double speed : {0.1, 1.0}) {
    const double radius = 0.01;
    const bank::Bank ball = make_steel_ball(radius);
    const Blow blow = strike(ball, radius, block, speed);
    EXPECT_GT(blow.restitution, 0.97) << speed;
    for (const double e : {0.2, 0.6}) {
      const double given = strike(ball, radius, block, speed, e).restitution;
      EXPECT_LE(given, e * (1.0 + 1e-6));
      EXPECT_GT(given, 0.98 * e);
    }
    ASSERT_EQ(blow.impulses.size(), 1U) << speed;
    const double m = ball.rigid.mass_kg, stiff = 0.5 * kSteel / (1.0 - kSteelPoisson * kSteelPoisson);
    // K. L. Johnson, "Contact mechanics" (1985), eq. 11.24.
    EXPECT_NEAR(blow.impulses[0].duration_s / (2.87 * std::pow(m * m / (radius * stiff * stiff * speed), 0.2)), 1.0, 0.02) << speed;
  }
}

class Falling : public testing::TestWithParam<std::array<double, 2>> {};
INSTANTIATE_TEST_SUITE_P(Plates, Falling,
                         testing::Values(std::array{0.3, 0.002}, std::array{0.2, 0.0005}, std::array{0.024, 0.002}));  // plate, sheet, coin

/// A plate that falls on a corner; `turn` chooses which way it is tilted.
WorldSpec make_fall(const bank::Bank& plate, double height_m, double restitution, int turn) {
  WorldSpec spec;
  spec.ground = GroundSpec{.restitution = restitution};
  BodySpec body;
  body.name = "plate";
  body.bank = &plate;
  body.restitution = restitution;
  body.initial.position_m = {0, 0, height_m};
  body.initial.rotation = {1.0, 0.1 + 0.2 * turn, 0.15 * turn, 0.0};
  spec.bodies = {body};
  return spec;
}

TEST_P(Falling, ModalEnergyBelowLossOfMotion) {
  const auto [side, thickness] = GetParam();
  const bank::Bank plate = make_plate_bank(side, thickness, side > 0.1 ? 6e3 : 60e3, 16, 3.0);
  const std::size_t modes = plate.mode_count();
  ASSERT_GT(modes, 5U);
  for (int turn = 0; turn < 3; ++turn) {
    World world(make_fall(plate, 0.6, 1.0, turn), {.end_s = 1.0, .audits_energy = true});
    const double end_s = 0.5;
    std::vector<events::Force> forces;
    events::BodyMotion last;
    world.advance(end_s, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
      if (const auto* f = std::get_if<events::Force>(&e)) forces.push_back(*f);
      if (const auto* m = std::get_if<events::BodyMotion>(&e)) last = *m;
    });
    const Statistics statistics = world.get_statistics();
    const EnergyAudit& energy = statistics.energy;
    ASSERT_FALSE(forces.empty());
    // Springs and modes explain the depth, also where the next corner comes while it rings by millimetres.
    EXPECT_LT(statistics.contacts.unexplained.unexplained_m, 1e-4) << turn << " at " << statistics.contacts.unexplained.time_s;
    EXPECT_GT(energy.max_modes_j, 1e-4 * plate.rigid.mass_kg);
    EXPECT_LT(energy.modes_share, 1.0);
    EXPECT_LT(energy.max_modes_j, plate.rigid.mass_kg * 9.81 * 0.6);
    EXPECT_LT(energy.error_j, 0.01 * energy.start_j);
    // The forces, played into the same modes: q(t) = Im sum f (e^{p (t - s)} - e^{p (t - s - h)}) / (p w_d), p = -d + i w_d.
    double played_j = 0.0;
    for (std::size_t i = 0; i < modes; ++i) {
      const double lambda = plate.eigenvalue_rad2_s2[i], d = plate.decay_per_s[i], damped = std::sqrt(lambda - d * d);
      const std::complex<double> p(-d, damped);
      std::complex<double> sum = 0.0;
      for (const events::Force& f : forces) {
        double phi = 0.0;
        for (std::size_t c = 0; c < 3; ++c) phi += f.barycentric[c] * plate.shape_at(plate.triangles[f.triangle][c], i)[2];
        for (int k = 0; k < f.count; ++k) {
          const double s = f.time_s + k * f.step_s;
          const double force = phi * f.impulse_n_s[k][2] / f.step_s;
          sum += force * (std::exp(p * (end_s - s)) - std::exp(p * (end_s - s - f.step_s))) / p;
        }
      }
      const double q = sum.imag() / damped, v = (p * sum).imag() / damped;
      played_j += 0.5 * (v * v + lambda * q * q);
    }
    EXPECT_NEAR(played_j, energy.modes_j, 0.002 * energy.modes_j) << turn;
    const double speed = norm(last.velocity_m_s);
    EXPECT_LT(played_j, plate.rigid.mass_kg * (9.81 * (0.6 - last.position_m[2]) - 0.5 * speed * speed)) << turn;
  }
}

TEST(SoftPlate, PulsesOfABlowHaveItsImpulseAndLessThanItsLoss) {
  // A plate as soft as rubber that falls on a corner would bend by many thicknesses: the blow is rigid, in two pulses.
  bank::Bank plate = make_plate_bank(0.15, 0.002, 8e3, 16, 20.0);
  const double softer = 1e8 / plate.material.young_modulus_pa;
  plate.material.young_modulus_pa *= softer;
  for (double& lambda : plate.eigenvalue_rad2_s2) lambda *= softer;
  const double mass_kg = plate.rigid.mass_kg;
  for (int turn = 0; turn < 3; ++turn) {
    World world(make_fall(plate, 0.3, 0.6, turn), {.end_s = 0.3, .audits_energy = true});
    std::vector<Impulse> pulses;
    std::vector<events::BodyMotion> motions;
    world.advance(0.3, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
      EXPECT_FALSE(std::holds_alternative<events::Force>(e)) << turn;
      if (const auto* p = std::get_if<Impulse>(&e)) pulses.push_back(*p);
      if (const auto* m = std::get_if<events::BodyMotion>(&e)) motions.push_back(*m);
    });
    std::size_t after = 1;  // motion after the first blow, at the time of the one before
    while (after < motions.size() && motions[after].time_s != motions[after - 1].time_s) ++after;
    ASSERT_LT(after, motions.size()) << turn;
    const events::BodyMotion &v = motions[after - 1], &w = motions[after];
    std::erase_if(pulses, [&](const Impulse& p) { return std::abs(p.time_s - 0.5 * p.duration_s - v.time_s) > 2e-4; });
    ASSERT_GE(pulses.size(), 2U);
    Vec3 impulse{};
    double shortest_s = 1.0, longest_s = 0.0;
    for (const Impulse& p : pulses) {
      impulse = impulse + p.impulse_n_s;
      shortest_s = std::min(shortest_s, p.duration_s);
      longest_s = std::max(longest_s, p.duration_s);
    }
    EXPECT_GT(longest_s, 2.0 * shortest_s) << turn;
    EXPECT_LE(longest_s, 0.2) << turn;
    const double change = mass_kg * norm(w.velocity_m_s - v.velocity_m_s);
    EXPECT_NEAR(norm(impulse), change, 1e-9 * change) << turn;
    double modes_j = 0.0;
    for (std::size_t i = 0; i < plate.mode_count(); ++i) {
      const double omega = std::sqrt(plate.eigenvalue_rad2_s2[i]);
      std::complex<double> speed = 0.0;
      for (const Impulse& p : pulses) {
        double phi = 0.0;
        for (std::size_t c = 0; c < 3; ++c) phi += p.barycentric[c] * plate.shape_at(plate.triangles[p.triangle][c], i)[2];
        const double part = std::sqrt(impact::calc_pulse_spectrum(omega * p.duration_s));
        speed += phi * p.impulse_n_s[2] * part * std::polar(1.0, -omega * p.time_s);
      }
      modes_j += 0.5 * std::norm(speed);
    }
    EXPECT_GT(modes_j, 0.0);
    EXPECT_LT(modes_j, 0.5 * mass_kg * dot(v.velocity_m_s, v.velocity_m_s)) << turn;
    const EnergyAudit energy = world.get_statistics().energy;
    EXPECT_LT(energy.modes_share, 1.0) << turn;
    EXPECT_LT(energy.error_j, 1e-6 * energy.start_j) << turn;
    EXPECT_LT(energy.lifted_j, 1e-2 * energy.kinetic_j) << turn;
  }
}

}  // namespace
}  // namespace carillon::physics::tests

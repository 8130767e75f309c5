// Balls on large plates against Zener's theory; a falling free plate.
#include <array>

#include "tests/unit/runtime/physics/impact/free_plate.hpp"
#include "tests/unit/runtime/physics/impact/scenes.hpp"
#include "tests/unit/runtime/physics/impact/zener.hpp"

namespace carillon::impact::tests {
namespace {

TEST(Plates, ZenersTables) {
  for (const auto& [lambda, e] :
       std::to_array<std::array<double, 2>>({{0.1, .843339}, {0.3, .605947}, {0.5, .436895}, {1.0, .184123}, {2.0, .020683}}))
    EXPECT_NEAR(calc_zener(lambda), e, 2e-6);
}

struct Case {
  double thickness, radius, speed, highest_hz;
};

TEST(Plates, ZenersRestitutionBeyondTheBand) {
  double nearest = 1e9, furthest = 0.0;
  for (const Case& c : std::to_array<Case>({{.006, .005, 1, 20e3},
                                            {.003, .005, 1, 20e3},
                                            {.006, .010, 1, 20e3},
                                            {.006, .015, 1, 20e3},
                                            {.003, .010, 1, 20e3},
                                            {.006, .020, 1, 20e3},
                                            {.003, .0075, 5, 20e3},
                                            {.006, .010, 5, 20e3},
                                            {.003, .0075, 1, 20e3},
                                            {.006, .005, .1, 20e3},
                                            {.003, .010, .1, 20e3},
                                            {.006, .015, 5, 20e3},
                                            {.006, .010, 1, 40e3}})) {
    const Plate plate = make_plate(1.0, 0.93, c.thickness, c.highest_hz, 0.47, 0.4929);
    const Modes modes(plate.omega, plate.decay, 2.0 * kPi * c.highest_hz);
    const Body ball = make_ball(c.radius, {0, 0, -c.speed});
    Body below;
    below.modes = &modes;
    std::vector<Contact> contacts{make_contact(c.radius, 0, 1)};
    contacts[0].shape_b = plate.shape;
    const double T = std::pow(ball.mass_kg / (contacts[0].spring.stiffness * std::sqrt(c.speed)), 0.4),
                 lambda = ball.mass_kg / (plate.impedance * T);
    const double wanted = calc_zener(lambda), cycles = 2.0 * kPi * c.highest_hz * 3.218 * T;
    const double e = run({ball, below}, contacts).get_bodies()[0].velocity_m_s[2] / c.speed;
    EXPECT_NEAR(e, wanted, std::max(0.03 * wanted, 0.003))
        << "h " << c.thickness << " R " << c.radius << " v " << c.speed << ": w_c tau " << cycles;
    nearest = std::min(nearest, cycles);
    furthest = std::max(furthest, cycles);
  }
  EXPECT_LT(nearest, 4.4);
  EXPECT_GT(furthest, 17.0);
}

TEST(Plates, ModalEnergyOfFallingPlate) {
  // 300 x 300 x 2 mm of steel from 0.6 m on concrete, on its corner, its edge and its face. A rigid impact of e = 0.5 gives some 100 J.
  const double side = 0.3, thickness = 0.002, v = 3.43;
  const FreePlate plate = make_free_plate(side, thickness, 20e3);
  // Leissa 1973: lowest frequency parameter w L^2 sqrt(rho h/D) of the free square plate, nu 0.3: 13.489 (13.468 by later work).
  const double D = kYoung * std::pow(thickness, 3) / 12.0 / (1.0 - kPoisson * kPoisson);
  EXPECT_NEAR(*std::min_element(plate.omega.begin(), plate.omega.end()) * side * side * std::sqrt(kDensity * thickness / D), 13.47, 0.03);
  ASSERT_GT(plate.omega.size(), 150U);
  const Modes modes(plate.omega, std::vector<double>(plate.omega.size(), 3.0), 2.0 * kPi * 20e3);
  for (const auto& [x, y] : std::to_array<std::array<double, 2>>({{0.995, 0.995}, {0.995, 0.1}, {0.3, 0.2}})) {
    Body body;
    body.mass_kg = plate.mass;
    const double flat = plate.mass * side * side / 12.0;
    body.inertia_kg_m2 = {{{flat, 0, 0}, {0, flat, 0}, {0, 0, 2.0 * flat}}};
    body.velocity_m_s = {0, 0, -v};
    body.acceleration_m_s2 = {0, 0, -9.81};
    body.modes = &modes;
    std::vector<double> shape;
    for (std::size_t i = 0; i < plate.omega.size(); ++i) shape.insert(shape.end(), {0.0, 0.0, plate.calc_shape(i, x, y)});
    Contact contact;
    contact.where_m = {0.5 * side * x, 0.5 * side * y, 0};
    contact.normal = {0, 0, 1};
    contact.shape_a = shape;
    contact.spring.stiffness = calc_hertz_stiffness(200e9, 0.3, 30e9, 0.2, 0.5e-3);
    for (const double e : {1.0, 0.5}) {
      contact.restitution = e;
      const std::vector<Contact> contacts{contact};
      Impact impact = run({body}, contacts, {.part_s = 1e-3});
      const Books books = impact.get_books();
      EXPECT_LE(books.modal, books.start + books.given - books.rigid) << x << " " << y;
      EXPECT_LT(books.modal, 7.5);  // all that 1.41 kg get in 0.6 m is 8.3 J
      EXPECT_GT(books.modal, 0.05);
      EXPECT_GT(impact.get_time(), 2e-3);  // pushed back by the bending modes, not by a pulse of 361 us
    }
  }
}

}  // namespace
}  // namespace carillon::impact::tests

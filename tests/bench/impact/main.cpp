// Cost of an impact, and of its accuracy: CPU time, restitution against steps per pulse, against Zener, and falling plates.
//
// usage: bench_impact [--quick]
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/physics/impact/predict.hpp"
#include "tests/unit/runtime/physics/impact/free_plate.hpp"
#include "tests/unit/runtime/physics/impact/scenes.hpp"
#include "tests/unit/runtime/physics/impact/zener.hpp"

namespace carillon::impact::tests {
namespace {

bool quick = false;

/// The least mean of several rounds [us].
template <class Work>
double time_us(Work&& work) {
  const int rounds = quick ? 1 : 15, repeats = quick ? 1 : 40;
  double min = 1e300;
  for (int round = 0; round < rounds; ++round) {
    const double begin = 1e6 * base::get_thread_cpu_s();
    for (int i = 0; i < repeats; ++i) work();
    min = std::min(min, (1e6 * base::get_thread_cpu_s() - begin) / repeats);
  }
  return min;
}

/// A ball on a simply supported plate of 1.00 x 0.93 m whose bank ends at 20 kHz.
struct Scene {
  Plate plate;
  Modes modes;
  std::vector<Body> bodies;
  std::vector<Contact> contacts;
  double lambda = 0.0, tau = 0.0;

  Scene(double thickness, double radius, double speed, double highest_hz = 20e3)
      : plate(make_plate(1.0, 0.93, thickness, highest_hz, 0.47, 0.4929)), modes(plate.omega, plate.decay, 2.0 * kPi * highest_hz) {
    bodies = {make_ball(radius, {0, 0, -speed}), Body{}};
    bodies[1].modes = &modes;
    contacts = {make_contact(radius, 0, 1)};
    contacts[0].shape_b = plate.shape;
    const double T = std::pow(bodies[0].mass_kg / (contacts[0].spring.stiffness * std::sqrt(speed)), 0.4);
    tau = 3.21807 * T;
    lambda = bodies[0].mass_kg / (plate.impedance * T);
  }
  Scene(const Scene&) = delete;
  double calc_restitution(const Options& options) const {
    Impact impact(bodies, contacts, options);
    impact.advance(1.0);
    return impact.get_bodies()[0].velocity_m_s[2] / -bodies[0].velocity_m_s[2];
  }
};

double find_peak(Impact& impact) {
  double peak = 0.0;
  for (const Pulse& pulse : impact.take_pulses())
    for (const Vec3& j : pulse.impulse_n_s) peak = std::max(peak, std::sqrt(dot(j, j)) / pulse.step_s);
  return peak;
}

void print_accuracy() {
  std::printf("\nThe price of accuracy: steel ball on a steel plate, 1 m/s; errors against 1024 steps per pulse\n");
  std::printf(
      "| h, R mm, bank to kHz | lambda | modes | steps per pulse | steps in all | e | error of e | error of the peak force | energy "
      "unbooked | us "
      "|\n");
  std::printf("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  // Where the bank ends at 20 kHz its edge is what keeps steps short.
  for (const auto& [h, radius, khz] : std::to_array<std::array<double, 3>>({{.010, .020, 5}, {.006, .020, 5}, {.006, .010, 20}})) {
    const Scene scene(h, radius, 1.0, 1e3 * khz);
    Impact fine(scene.bodies, scene.contacts, {.steps_per_pulse = quick ? 64.0 : 1024.0});
    fine.advance(1.0);
    const double e = fine.get_bodies()[0].velocity_m_s[2], peak = find_peak(fine);
    for (const double steps : {5.0, 8.0, 10.0, 14.0, 20.0, 28.0, 40.0, 64.0}) {
      Impact impact(scene.bodies, scene.contacts, {.steps_per_pulse = steps});
      impact.advance(1.0);
      const double error = impact.get_books().calc_error(), other = impact.get_bodies()[0].velocity_m_s[2];
      const int count = impact.get_steps();
      const double us = time_us([&] { Impact(scene.bodies, scene.contacts, {.steps_per_pulse = steps}).advance(1.0); });
      std::printf("| %g, %g, %g | %.3f | %d | %.0f | %d | %.5f | %.5f | %.2f %% | %.0e | %.0f |\n", 1e3 * h, 1e3 * radius, khz,
                  scene.lambda, scene.modes.size(), steps, count, other, other - e, 100.0 * (find_peak(impact) / peak - 1.0),
                  std::abs(error), us);
    }
  }
}

void print_zener() {
  std::printf("\nAgainst Zener, 20 steps per pulse, with and without the modes above the band\n");
  std::printf(
      "| h, R mm, v m/s, bank to kHz | lambda | w_c tau | Zener | e | without | off by, of max(3 %%, 0.003) "
      "|\n|---|--:|--:|--:|--:|--:|--:|\n");
  for (const auto& [h, radius, v, khz] : std::to_array<std::array<double, 4>>({{.006, .005, 1, 20},
                                                                               {.003, .005, 1, 20},
                                                                               {.003, .0075, 5, 20},
                                                                               {.006, .010, 5, 20},
                                                                               {.003, .0075, 1, 20},
                                                                               {.006, .010, 1, 20},
                                                                               {.003, .010, 1, 20},
                                                                               {.006, .015, 1, 20},
                                                                               {.006, .020, 1, 20},
                                                                               {.006, .005, 1, 60},
                                                                               {.003, .010, 1, 60}})) {
    if (quick && khz > 20) continue;
    const Scene scene(h, radius, v, 1e3 * khz);
    const double wanted = calc_zener(scene.lambda), e = scene.calc_restitution({}), bare = scene.calc_restitution({.above_band = false});
    std::printf("| %g, %g, %g, %g | %.3f | %.1f | %.4f | %.4f | %.4f | %.2f |\n", 1e3 * h, 1e3 * radius, v, khz, scene.lambda,
                2e3 * kPi * khz * scene.tau, wanted, e, bare, std::abs(e - wanted) / std::max(0.03 * wanted, 0.003));
  }
}

void print_cost() {
  std::printf("\nCost: 250 + 250 modes, a Hertz-like pulse, 20 steps per pulse; a quiet time of one step ends it\n");
  std::printf(
      "| contacts | friction | steps | us an impact | us a step | us to make it | us with cold propagators "
      "|\n|--:|--:|--:|--:|--:|--:|--:|\n");
  std::vector<double> omega_a, omega_b, decay(250, 5.0), shape_a, shape_b;
  for (int i = 0; i < 250; ++i) {
    omega_a.push_back(2.0 * kPi * (100.0 + 79.0 * i));
    omega_b.push_back(2.0 * kPi * (120.0 + 78.0 * i));
    shape_a.insert(shape_a.end(), {0.02, 0.01, 0.05 + 0.03 * std::sin(i)});
    shape_b.insert(shape_b.end(), {0.01, 0.02, 0.05 + 0.03 * std::cos(i)});
  }
  const Modes a(omega_a, decay), b(omega_b, decay);
  for (const double friction : {0.0, 0.3})
    for (const int count : {1, 2, 4, 8}) {
      Body one, two;
      one.mass_kg = two.mass_kg = 0.4;
      one.inertia_kg_m2 = two.inertia_kg_m2 = {{{4e-4, 0, 0}, {0, 4e-4, 0}, {0, 0, 4e-4}}};
      one.velocity_m_s = {0.3, 0, -1.0};
      one.centre_m = {0, 0, 0.02};
      two.centre_m = {0, 0, -0.02};
      one.modes = &a;
      two.modes = &b;
      std::vector<Contact> contacts;
      for (int c = 0; c < count; ++c) {
        Contact contact = make_contact(0.004, 0, 1);
        contact.where_m = {0.01 * std::cos(6.3 * c / count), 0.01 * std::sin(6.3 * c / count), 0};
        if (count == 1) contact.where_m = {};
        contact.friction = friction;
        contact.shape_a = shape_a;
        contact.shape_b = shape_b;
        contacts.push_back(contact);
      }
      const Options options{.part_s = 1e-9};
      Impact impact({one, two}, contacts, options);
      impact.advance(1.0);
      const double whole = time_us([&] { Impact({one, two}, contacts, options).advance(1.0); });
      const double making = time_us([&] { Impact({one, two}, contacts, options); });
      const double cold = time_us([&] {
        const Modes fresh_a(omega_a, decay), fresh_b(omega_b, decay);
        Body x = one, y = two;
        x.modes = &fresh_a;
        y.modes = &fresh_b;
        Impact({x, y}, contacts, options).advance(1.0);
      });
      std::printf("| %d | %g | %d | %.1f | %.2f | %.1f | %.1f |\n", count, friction, impact.get_steps(), whole,
                  (whole - making) / impact.get_steps(), making, cold);
    }
  std::vector<double> phi_a, phi_b;
  for (std::size_t i = 2; i < shape_a.size(); i += 3) {
    phi_a.push_back(shape_a[i]);
    phi_b.push_back(shape_b[i]);
  }
  const double us = time_us([&] {
    static_cast<void>(predict({1e10, 1.5, 0.0}, 0.2, 1.0, 0.8, {.modes = &a, .phi = phi_a, .q = {}, .q_dot = {}},
                              {.modes = &b, .phi = phi_b, .q = {}, .q_dot = {}}));
  });
  std::printf("\nPrediction (predict.hpp), 250 + 250 modes: %.1f us\n", us);
}

void print_falls() {
  std::printf("\nA free steel plate, 300 x 300 x 2 mm, falls at 3.43 m/s on concrete: until it has parted for 2 ms\n");
  std::printf(
      "| struck | restitution given | energy before J | modes J | motion J | lost in modes J | in the contact J | above the band J | "
      "impulse N s | length ms | steps | us |\n");
  std::printf("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  const FreePlate plate = make_free_plate(0.3, 0.002, quick ? 3e3 : 20e3);
  const Modes modes(plate.omega, std::vector<double>(plate.omega.size(), 3.0), 2.0 * kPi * (quick ? 3e3 : 20e3));
  struct Spot {
    const char* name;
    double x, y;
  };
  for (const Spot& spot : {Spot{"corner", 0.995, 0.995}, Spot{"edge", 0.995, 0.1}, Spot{"face", 0.3, 0.2}})
    for (const double restitution : {1.0, 0.5}) {
      Body body;
      body.mass_kg = plate.mass;
      const double flat = plate.mass * 0.09 / 12.0;
      body.inertia_kg_m2 = {{{flat, 0, 0}, {0, flat, 0}, {0, 0, 2.0 * flat}}};
      body.velocity_m_s = {0, 0, -3.43};
      body.acceleration_m_s2 = {0, 0, -9.81};
      body.modes = &modes;
      std::vector<double> shape;
      for (std::size_t i = 0; i < plate.omega.size(); ++i) shape.insert(shape.end(), {0.0, 0.0, plate.calc_shape(i, spot.x, spot.y)});
      Contact contact;
      contact.where_m = {0.15 * spot.x, 0.15 * spot.y, 0};
      contact.normal = {0, 0, 1};
      contact.restitution = restitution;
      contact.shape_a = shape;
      contact.spring.stiffness = calc_hertz_stiffness(200e9, 0.3, 30e9, 0.2, 0.5e-3);
      Impact impact({body}, {contact}, {.part_s = 2e-3});
      impact.advance(0.1);
      const Books k = impact.get_books();
      const double us = time_us([&] { Impact({body}, {contact}, {.part_s = 2e-3}).advance(0.1); });
      std::printf("| %s | %g | %.2f | %.2f | %.2f | %.3f | %.2f | %.3f | %.2f | %.1f | %d | %.0f |\n", spot.name, restitution,
                  k.start + k.given, k.modal, k.rigid, k.dissipated_modes, k.dissipated_contact, k.above_band, impact.get_impulse(0),
                  1e3 * impact.get_time() - 2.0, impact.get_steps(), us);
    }
}

}  // namespace
}  // namespace carillon::impact::tests

int main(int argc, char** argv) {
  using namespace carillon::impact::tests;
  if (argc > 2 || (argc == 2 && std::strcmp(argv[1], "--quick") != 0)) {
    std::fprintf(stderr, "usage: bench_impact [--quick]\n");
    return 2;
  }
  quick = argc == 2;
  print_cost();
  print_accuracy();
  print_zener();
  print_falls();
}

// Cost of coupled modes per sample, by number and form: energies of made-up numbers, motion of about a thickness without loss.
//
// usage: bench_nonlinear SAMPLES     one line a case: form, modes, points, rows, microseconds a sample, bytes of the matrices
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/synth/nonlinear/coupled_modes.hpp"
#include "tests/unit/runtime/synth/nonlinear/bodies.hpp"

namespace {

using namespace carillon;

struct Case {
  const char* form;
  std::size_t modes, points, rows;
};
constexpr Case kCases[] = {{"points", 30, 64, 40}, {"points", 50, 128, 80}, {"points", 100, 256, 160}, {"rows", 30, 0, 40},
                           {"rows", 50, 0, 80},    {"rows", 30, 0, 10},     {"stretch", 30, 0, 2},     {"stretch", 200, 0, 2},
                           {"plate", 30, 0, 0},    {"plate", 50, 0, 0},     {"plate", 100, 0, 0},      {"plate-as-rows", 50, 0, 0}};

/// A hinged plate in closed form; as rows: with something in place of its zeros, so that none of them is left out.
bank::QuarticEnergy make_plate(const Case& what) {
  bank::QuarticEnergy energy = nonlinear::bodies::Plate().make(what.modes, [](double) { return 0.0; }).energy;
  if (std::string_view(what.form) == "plate") return energy;
  for (float& entry : energy.rows)
    if (entry == 0.0F) entry = 1e-9F;
  return energy;
}

bank::QuarticEnergy make_energy(const Case& what) {
  if (std::string_view(what.form).starts_with("plate")) return make_plate(what);
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  bank::QuarticEnergy energy;
  for (std::size_t i = 0; i < what.modes; ++i) energy.modes.push_back(static_cast<std::int32_t>(i));
  const bool is_stretch = std::string_view(what.form) == "stretch";
  if (what.points == 0) {
    for (std::size_t r = 0; r < what.rows; ++r)
      for (std::size_t j = 0; j < what.modes; ++j)
        for (std::size_t i = 0; i <= j; ++i) energy.rows.push_back(is_stretch && i != j ? 0.0F : 1e5F * normal(random));
    return energy;
  }
  for (std::size_t i = 0; i < what.points * 6 * what.modes; ++i) energy.gradient.push_back(30.0F * normal(random));
  for (std::size_t i = 0; i < what.rows * what.points * 3; ++i) energy.stress.push_back(30.0F * normal(random));
  energy.weight.assign(what.points, 1.0);
  return energy;
}

/// Microseconds of a step, and whether the guard was needed, in which case the figure is of another path.
double time_us(const Case& what, int samples) {
  const bank::QuarticEnergy energy = make_energy(what);
  std::vector<nonlinear::ModeConstants> constants;
  for (std::size_t i = 0; i < what.modes; ++i)
    constants.push_back({std::pow(2.0 * std::numbers::pi * (60.0 + 40.0 * static_cast<double>(i)), 2), 0.0});
  nonlinear::CoupledModes modes(energy, constants, 48000.0);
  const double amplitude = std::sqrt(constants[0].eigenvalue_rad2_s2 / (2.0 * bank::calc_self_coupling(energy)[0]));
  std::vector<double> re(what.modes), im(what.modes);
  for (std::size_t i = 0; i < what.modes; ++i)
    re[i] = 0.3 * amplitude * std::sqrt(constants[i].eigenvalue_rad2_s2) / (1.0 + static_cast<double>(i));
  modes.step(re, im);
  for (int n = 0; n < samples / 10; ++n) modes.step();
  const double begin = base::get_thread_cpu_s();
  for (int n = 0; n < samples; ++n) modes.step();
  const double used = base::get_thread_cpu_s() - begin;
  fmt::print("{} {} {} {} {:.4f} {}\n", what.form, what.modes, what.points, energy.row_count(), 1e6 * used / samples, modes.calc_bytes());
  return used;
}

}  // namespace

int main(int argc, char** argv) {
  const int samples = argc > 1 ? std::atoi(argv[1]) : 0;
  if (samples < 10) {
    fmt::print(stderr, "usage: bench_nonlinear SAMPLES\n");
    return 2;
  }
  double total = 0.0;
  for (const Case& what : kCases) total += time_us(what, samples);
  return total >= 0.0 ? 0 : 1;
}

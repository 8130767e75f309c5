// What a body costs before the first sample: CPU time of each part, against that of playing all its modes for a second.
//
// usage: bench_setup [--quick] [BANK...]     without banks: a sphere of 81,920 triangles with 250 modes (--quick: 1,280 and 25)
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/physics/world.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "tests/unit/runtime/acoustics/radiation/sphere_bank.hpp"

namespace {

using namespace carillon;

/// The least of three.
template <class Work>
double time_ms(Work&& work) {
  double min = 1e300;
  for (int round = 0; round < 3; ++round) {
    const double begin = 1e3 * base::get_thread_cpu_s();
    work();
    min = std::min(min, 1e3 * base::get_thread_cpu_s() - begin);
  }
  return min;
}

bank::Bank make_sphere(int level, int modes) {
  bank::Bank bank = testing::make_sphere_surface(0.1, level);
  std::vector<double> ka;
  for (int m = 0; m < modes; ++m) ka.push_back(0.5 + 20.0 * m / modes);
  testing::set_modes(bank, ka, 0.1, [](const carillon::Vec3& x, std::size_t m) {
    const double wave = std::sin(40.0 * x[0] + static_cast<double>(m)) * std::cos(30.0 * x[1] * static_cast<double>(1 + m % 7)) / 0.1;
    return carillon::Vec3{wave * x[0], wave * x[1], wave * x[2]};
  });
  bank.rigid = {.mass_kg = 1.0, .centre_m = {}, .inertia_kg_m2 = {4e-3, 0, 0, 0, 4e-3, 0, 0, 0, 4e-3}, .volume_m3 = 4.2e-3};
  bank.material = {.young_modulus_pa = 7e10, .poisson_ratio = 0.3, .density_kg_m3 = 240.0, .alpha1_s = 0.0, .alpha2_per_s = 2.0};
  return bank;
}

void print_row(const std::string& name, bank::Bank& bank, double read_ms) {
  const double gains = time_ms([&] { bank.radiation_gain = radiation::calc_gains(bank, radiation::GainKind::kSphere); });
  std::shared_ptr<const synth::Model> model;
  const double making = time_ms([&] { model = synth::Model::make(bank, {.rate_hz = 48000.0}); });
  physics::WorldSpec spec;
  spec.bodies.resize(1);
  spec.bodies[0].name = "body";
  spec.bodies[0].bank = &bank;
  const double world = time_ms([&] { physics::World made(spec); });
  double playing = 1e300;
  for (int round = 0; round < 3; ++round) {
    synth::ResonatorBank voice(model, {.silence_pa = 1e-30});
    voice.strike({.time_s = 1e-4, .impulse_n_s = {0.3, 0.5, 1}});
    std::array<float, synth::kBlock> block{};
    const double begin = 1e3 * base::get_thread_cpu_s();
    for (int i = 0; i < 375; ++i) {
      block.fill(0.0F);
      voice.process(block);
    }
    playing = std::min(playing, 1e3 * base::get_thread_cpu_s() - begin);
  }
  const double all = read_ms + gains + making + world;
  fmt::print("| {} | {} | {} | {:.0f} | {:.0f} | {:.0f} | {:.0f} | {:.0f} | {:.0f} |\n", name, bank.triangles.size(), bank.mode_count(),
             read_ms, gains, making, world, all, all / playing);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> files(argv + 1, argv + argc);
  const bool quick = std::erase(files, "--quick") > 0;
  fmt::print(
      "| bank | triangles | modes | read, ms | gains | tables | surface | all | over a second of playing "
      "|\n|---|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  if (files.empty()) {
    bank::Bank sphere = quick ? make_sphere(3, 25) : make_sphere(6, 250);
    print_row("sphere", sphere, 0.0);
  }
  for (const std::string& file : files) {
    bank::Bank bank;
    const double read_ms = time_ms([&] { bank = bank::read_bank(file); });
    print_row(file.substr(file.rfind('/') + 1), bank, read_ms);
  }
  return 0;
}

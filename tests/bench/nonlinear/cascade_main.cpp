// Motion of a bank's modes after a blow, for tests/bench/nonlinear/cascade: linear, coupled, or coupled with a cascade above.
//
// usage: bench_cascade BANK linear|coupled|cascade X Y IMPULSE_N_S PULSE_S SECONDS OUT [CONSTANT]
//        bench_cascade --time MODES SAMPLES
//
// The blow is on the vertex next to (X, Y) [m], across the sheet, at 1 ms; OUT gets the velocity of each mode at each sample, 48 kHz,
// single precision, modes of a sample together. The last line printed: seconds of processor time, J put in, J at the end. --time:
// microseconds a sample of a cascade of so many modes.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/synth/nonlinear/cascade.hpp"

namespace {

using namespace carillon;
constexpr double kRate = 48000.0;

int time_cascade(int modes, int samples) {
  std::vector<nonlinear::ModeConstants> coupled, above;
  for (int i = 0; i < 2; ++i) coupled.push_back({std::pow(2.0 * std::numbers::pi * (100.0 + 40.0 * i), 2), 2.0});
  for (int i = 0; i < modes; ++i) above.push_back({std::pow(2.0 * std::numbers::pi * (200.0 + 40.0 * i), 2), 2.0});
  bank::QuarticEnergy energy;
  energy.modes = {0, 1};
  energy.rows = {1e4F, 1e3F, 2e4F};
  nonlinear::CoupledModes low(energy, coupled, kRate);
  nonlinear::Cascade high(coupled, above, {.mass_kg = 0.25, .thickness_m = 5e-4}, kRate);
  low.set_state(0, 0.0, 0.3);
  low.set_state(1, 0.0, 0.3);
  const auto run = [&](int count, bool has_cascade) {
    const double begin = base::get_thread_cpu_s();
    for (int n = 0; n < count; ++n) {
      low.step();
      if (has_cascade) high.step(low, {}, {}, {});
    }
    return 1e6 * (base::get_thread_cpu_s() - begin) / count;
  };
  run(samples / 10, true);
  const double with = run(samples, true), without = run(samples, false);
  fmt::print("{} {:.4f} {}\n", modes, with - without, high.calc_bytes());
  return high.get_book().taken_j > 0.0 ? 0 : 1;
}

int play(char** argv, double constant) {
  const bank::Bank bank = bank::read_bank(argv[1]);
  const std::string kind = argv[2];
  const double x = std::atof(argv[3]), y = std::atof(argv[4]), impulse = std::atof(argv[5]), pulse_s = std::atof(argv[6]);
  const auto samples = static_cast<int>(std::atof(argv[7]) * kRate);
  const std::size_t count = bank.mode_count();
  std::vector<nonlinear::ModeConstants> all;
  for (std::size_t m = 0; m < count; ++m) {
    const double lambda = bank.eigenvalue_rad2_s2[m];
    all.push_back({lambda, bank.decay_per_s[m]});
  }
  std::size_t vertex = 0;
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) {
    const auto away = [&](std::size_t at) { return std::hypot(bank.vertices_m[at][0] - x, bank.vertices_m[at][1] - y); };
    if (away(v) < away(vertex)) vertex = v;
  }
  std::vector<std::size_t> order;  // coupled, above, then those that are linear
  for (const std::int32_t m : bank.quartic.modes) order.push_back(static_cast<std::size_t>(m));
  for (std::size_t m = 0; m < count; ++m)
    if (std::find(order.begin(), order.end(), m) == order.end()) order.push_back(m);
  std::vector<nonlinear::ModeConstants> constants;
  std::vector<double> push(count);
  for (std::size_t i = 0; i < count; ++i) {
    constants.push_back(all[order[i]]);
    push[i] = impulse * bank.shape_at(vertex, order[i])[2];
  }
  const std::size_t low = bank.quartic.mode_count();
  const std::span<const nonlinear::ModeConstants> of_coupled(constants.data(), low), of_above(constants.data() + low, count - low);
  nonlinear::CoupledModes coupled(bank.quartic, of_coupled, kRate);
  nonlinear::CoupledModes still(bank.quartic, of_coupled, kRate);  // what a cascade sees that is off
  const bool has_cascade = kind == "cascade";
  nonlinear::Cascade above(of_coupled, of_above, {.mass_kg = bank.rigid.mass_kg, .thickness_m = bank.quartic.thickness_m}, kRate,
                           {.constant = has_cascade ? constant : 1e-30});  // too little to be passed on
  if (kind == "linear") coupled.set_limit(0);
  std::FILE* out = std::fopen(argv[8], "wb");
  if (out == nullptr) return 4;
  std::vector<float> row(count);
  std::vector<double> re(count), im(count, 0.0);
  const double begin = base::get_thread_cpu_s();
  for (int s = 0; s < samples; ++s) {
    const double t = (s / kRate - 1e-3) / pulse_s + 0.5;  // the pulse: sin^2 over its length
    const double part = t > 0.0 && t < 1.0 ? 2.0 * std::pow(std::sin(std::numbers::pi * t), 2) / (pulse_s * kRate) : 0.0;
    for (std::size_t i = 0; i < count; ++i) re[i] = part * push[i];
    const std::span<const double> r(re), z(im);
    if (part > 0.0)
      coupled.step(r.first(low), z.first(low));
    else
      coupled.step();
    auto& of = has_cascade ? coupled : still;
    if (part > 0.0)
      above.step(of, r.subspan(low), z.subspan(low), {});
    else
      above.step(of, {}, {}, {});
    for (std::size_t i = 0; i < low; ++i) row[i] = static_cast<float>(coupled.get_velocity(static_cast<int>(i)));
    for (std::size_t i = low; i < count; ++i) row[i] = static_cast<float>(above.get_velocity(static_cast<int>(i - low)));
    std::fwrite(row.data(), sizeof(float), row.size(), out);
  }
  std::fclose(out);
  fmt::print("{} {:.4f} {:.6g} {:.6g} {:.6g} {:.6g} {}\n", count, base::get_thread_cpu_s() - begin, coupled.get_work_j(),
             coupled.get_energy_j() + above.calc_energy_j(), above.get_book().taken_j, above.get_book().lost_j,
             coupled.get_counters().guarded);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 4 && std::string(argv[1]) == "--time") return time_cascade(std::atoi(argv[2]), std::atoi(argv[3]));
  if (argc < 9) {
    fmt::print(stderr, "usage: bench_cascade BANK linear|coupled|cascade X Y IMPULSE_N_S PULSE_S SECONDS OUT [CONSTANT]\n");
    return 2;
  }
  return play(argv, argc > 9 ? std::atof(argv[9]) : nonlinear::CascadeOptions{}.constant);
}

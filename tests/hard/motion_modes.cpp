// Hard cases of coupled modes that play: three blows in a row, ten minutes without an end.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <vector>

#include "runtime/synth/fp_guard.hpp"
#include "tests/hard/figure.hpp"
#include "tests/unit/runtime/synth/nonlinear/blows.hpp"

namespace carillon::hard {
namespace {

using nonlinear::CoupledModes;
using nonlinear::CoupledOptions;
using nonlinear::Integrator;
using nonlinear::bodies::Body;
using nonlinear::bodies::Plate;

constexpr double kRateHz = 48000.0;

double find_cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The pitch after the last blow against Kirchhoff's plate, whatever takes the steps; the blows themselves raise it by an octave.
TEST(motion, three_blows) {
  const double wanted_hz = Plate{}.find_modes(1)[0].omega / (2.0 * nonlinear::bodies::kPi);
  struct Way {
    const char* name;
    Integrator integrator;
  };
  for (const Way& way : {Way{"Verlet with a guard", Integrator::kGuarded}, Way{"auxiliary variable", Integrator::kAuxiliary}}) {
    const auto glide = nonlinear::bodies::strike_three_times(kRateHz, {.integrator = way.integrator, .relaxation_s = 0.01});
    ASSERT_EQ(glide.window_hz.size(), 16U);
    for (const std::size_t struck : {0U, 4U, 8U}) EXPECT_GT(glide.window_hz[struck], 2.0 * wanted_hz);  // it was large motion
    hold("three_blows", std::abs(1200.0 * std::log2(glide.window_hz[15] / wanted_hz)), 1.0, std::string(way.name) + ", cents at the end");
  }
}

/// The first mode rings all the time, the fourth is over after three minutes: its numbers pass through those that processors are slow with.
double decay_slowly(double omega) { return 0.012 * std::pow(omega / Plate{}.find_modes(1)[0].omega, 4.0); }

TEST(motion, ten_minutes) {
  const synth::FpGuard guard;  // as the synthesiser has it
  const Plate plate;
  const Body body = plate.make(4, decay_slowly);
  CoupledModes modes(body.energy, body.modes, kRateHz);
  // A thickness in the first mode, half of it in the others.
  for (int i = 0; i < 4; ++i) modes.set_state(i, (i == 0 ? 1.0 : 0.5) * plate.thickness_m / plate.calc_amplitude(), 0.0);
  double rise = 0.0, half_j = 0.0;
  std::vector<double> minute_s;
  std::int64_t bad = 0;
  modes.step();
  double before = modes.get_energy_j();
  for (int minute = 0; minute < 10; ++minute) {
    const double begin = find_cpu_s();
    for (int second = 0; second < 60; ++second) {
      for (int n = 0; n < 48000; ++n) modes.step();
      const double energy = modes.get_energy_j();
      rise = std::max(rise, energy / before - 1.0);
      before = energy;
      for (int i = 0; i < 4; ++i) bad += !std::isfinite(modes.get_velocity(i)) || !std::isfinite(modes.get_amplitude(i));
    }
    minute_s.push_back(find_cpu_s() - begin);
    if (minute == 4) half_j = before;
  }
  EXPECT_EQ(modes.get_counters().steps, 28'800'001);
  hold("ten_minutes", static_cast<double>(bad), 0, "states that are no numbers");
  hold("ten_minutes", rise, 0, "greatest rise of the energy from second to second, relative");
  // Softly, one mode alone: its energy goes with exp(-2 d t).
  hold("ten_minutes", std::abs(before / half_j * std::exp(2.0 * body.modes[0].decay_per_s * 300.0) - 1.0), 0.01,
       "energy of the last five minutes against the decay, relative");
  hold("ten_minutes", minute_s.back() / minute_s.front(), 1.5, "CPU time of the last minute over that of the first");
  hold("ten_minutes", (minute_s.front() + minute_s.back()) / 120.0, 0.05, "share of a core, four modes");
}

}  // namespace
}  // namespace carillon::hard

// Cost of a pulse given step by step in the synthesiser, by its number of steps, compared with the Hertz pulse of the same length.
//
// usage: bench_forces [--quick]       prints the table of docs/decisions/contact-pulses.md
//
// Method:     a voice that rings plays blocks of 128 frames with a pulse in each, and the same blocks without; CPU time of the thread,
//             medians of rounds that alternate.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace {

using namespace carillon;

constexpr double kRate = 48000.0;
constexpr std::int64_t kFrames = 128;

using Strike = std::function<void(synth::ResonatorBank&, double)>;

/// Microseconds that a pulse takes, begun `time_s` after each other block: median of the differences to blocks without.
double measure(int modes, const Strike& strike, double length_s, int blocks, int rounds) {
  std::vector<testing::InventedMode> invented;
  for (int m = 0; m < modes; ++m) invented.push_back({50.0 * std::pow(400.0, m / (modes + 1.0)), 0.0, 1e-3, {0.3, -0.2, 1.0}});
  synth::ResonatorBank voice(synth::Model::make(testing::make_cube_bank(invented), {.rate_hz = kRate}), {.max_forces = 1024});
  voice.strike({.impulse_n_s = {0.0, 0.0, 1.0}});
  std::array<float, kFrames> block{};
  const auto gap = static_cast<std::int64_t>(std::ceil((length_s * kRate + 1.0) / kFrames));  // blocks from pulse to pulse
  const auto play = [&](bool strikes) {
    const double started = base::get_thread_cpu_s();
    for (std::int64_t b = 0; b < blocks; ++b) {
      if (strikes && b % gap == 0) strike(voice, (static_cast<double>(voice.get_horizon()) + 3.3) / kRate);
      voice.process(block);
    }
    return base::get_thread_cpu_s() - started;
  };
  play(true);
  std::vector<double> differences;
  for (int round = 0; round < rounds; ++round) {
    const double without = play(false);
    differences.push_back(1e6 * (play(true) - without) / std::ceil(static_cast<double>(blocks) / static_cast<double>(gap)));
  }
  std::sort(differences.begin(), differences.end());
  return differences[differences.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  const int blocks = quick ? 20 : 2000, rounds = quick ? 1 : 9;
  std::printf(
      "| pulse, ms | steps | events | 256 modes: along one direction, us | with friction | 1,000 modes: along one | with friction |\n");
  std::printf("|--:|--:|--:|--:|--:|--:|--:|\n");
  struct Case {
    double length_s;
    int steps;
  };
  for (const Case& c : {Case{1e-4, 0}, Case{1e-4, 1}, Case{1e-4, 10}, Case{1e-4, 20}, Case{1e-4, 40}, Case{1e-4, 80}, Case{2e-3, 0},
                        Case{2e-3, 20}, Case{2e-3, 40}, Case{2e-3, 200}, Case{13e-3, 0}, Case{13e-3, 1300}}) {
    std::array<double, 4> us{};
    for (std::size_t i = 0; i < us.size(); ++i) {
      const int modes = i < 2 ? 256 : 1000;
      const bool rubs = i % 2 == 1;
      std::vector<carillon::Vec3> steps;
      for (int k = 0; k < c.steps; ++k) {
        const double x = (k + 0.5) / c.steps, force = 1e-3 * std::pow(std::sin(std::numbers::pi * x), 1.5);
        steps.push_back({rubs ? 0.2 * force * std::cos(3.0 * x) : 0.0, 0.0, force});
      }
      us[i] = measure(
          modes,
          [&](synth::ResonatorBank& voice, double time_s) {
            if (c.steps == 0) {
              voice.strike({.time_s = time_s + 0.5 * c.length_s, .impulse_n_s = {0.0, 0.0, 1e-3}, .duration_s = c.length_s});
            } else {
              events::split_force({.time_s = time_s, .step_s = c.length_s / c.steps}, steps,
                                  [&](const events::Force& piece) { voice.push(piece); });
            }
          },
          c.length_s, blocks, rounds);
    }
    const std::string steps = c.steps > 0 ? std::to_string(c.steps) : "Hertz";
    std::printf("| %g | %s | %d | %.1f | %.1f | %.1f | %.1f |\n", 1e3 * c.length_s, steps.c_str(),
                std::max(1, (c.steps + events::kMaxForceSteps - 1) / events::kMaxForceSteps), us[0], us[1], us[2], us[3]);
  }
  return 0;
}

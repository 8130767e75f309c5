// How long a block takes when it hails: Synthesiser::process against the time that a sound card gives.
//
// usage: bench_deadline [--quick]       prints the table of docs/reports/performance-runtime.md
//
// Method:     bodies of 200 modes that share a bank, two microphones, blocks of 64 frames at 48 kHz (1.333 ms); every body is struck 200
//             times a second, by pulses of 0.05 to 0.5 ms at random times; every second body moves. Each call is timed by the clock, which
//             sees what a host would: other programs too. Events are pushed between the calls.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace {

using namespace carillon;

constexpr double kRate = 48000.0;
constexpr int kFrames = 64;
constexpr double kDeadlineUs = 1e6 * kFrames / kRate;
constexpr double kStrikesPerS = 200.0;

std::shared_ptr<const synth::Model> make_model() {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 200; ++m) modes.push_back({80.0 * std::pow(200.0, m / 200.0), 2.0 + 0.2 * m, 1e-3, {0.5, 0.3, 1.0}, 0.1});
  return synth::Model::make(testing::make_cube_bank(modes), {.rate_hz = kRate});
}

void run(int bodies, double budget, double seconds) {
  synth::Synthesiser synthesiser({.rate_hz = kRate, .max_bodies = bodies, .ring_events = 1 << 16, .budget = budget});
  const auto model = make_model();
  for (int b = 0; b < bodies; ++b) synthesiser.add_body(model, {.position_m = {0.1 * b, 2.0, 0.0}});
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::exponential_distribution<double> gap(kStrikesPerS * bodies);
  std::array<float, kFrames> left{}, right{};
  const std::array<float*, 2> out{left.data(), right.data()};
  std::vector<double> times_us;
  double next_s = 0.0, next_move_s = 0.0;
  const auto blocks = static_cast<int>(seconds * kRate / kFrames);
  for (int block = 0; block < blocks; ++block) {
    const double ahead_s = synthesiser.get_time_s() + 0.02;
    for (; next_s < ahead_s; next_s += gap(random)) {
      const auto body = static_cast<int>(unit(random) * bodies);
      synthesiser.push(events::Impulse{.time_s = next_s,
                                       .body = body,
                                       .triangle = static_cast<int>(12 * unit(random)),
                                       .impulse_n_s = {0.0, 1e-4 * unit(random), 1e-3 * unit(random)},
                                       .duration_s = 5e-5 + 4.5e-4 * unit(random)});
    }
    for (; next_move_s < ahead_s; next_move_s += 0.01) {
      for (int b = 0; b < bodies; b += 2)
        synthesiser.push(
            events::BodyMotion{next_move_s, b, {0.1 * b + std::sin(next_move_s), 2.0, 0.0}, {std::cos(next_move_s), 0.0, 0.0}});
    }
    const auto started = std::chrono::steady_clock::now();
    synthesiser.process(out.data(), 2, kFrames);
    const std::chrono::duration<double, std::micro> spent = std::chrono::steady_clock::now() - started;
    if (block >= blocks / 10) times_us.push_back(spent.count());  // once everything rings
  }
  std::sort(times_us.begin(), times_us.end());
  const auto pick = [&](double share) { return times_us[share * static_cast<double>(times_us.size() - 1)]; };
  const synth::SynthesiserCounters counters = synthesiser.get_counters();
  const double played_s = static_cast<double>(blocks) * kFrames / kRate;
  std::printf("| %d | %.2f | %.2f | %.0f | %.0f | %.0f | %.0f | %.0f %% | %lld | %lld |\n", bodies, 1e-9 * budget,
              1e-9 * static_cast<double>(counters.mode_samples) / played_s, pick(0.5), pick(0.99), pick(0.999), times_us.back(),
              100.0 * pick(0.999) / kDeadlineUs, static_cast<long long>(counters.strikes),
              static_cast<long long>(counters.refused + counters.late + counters.overflows));
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  std::printf("Microseconds per block of %d frames (%.0f at 48 kHz); bodies of 200 modes, %.0f strikes a second each:\n\n", kFrames,
              kDeadlineUs, kStrikesPerS);
  std::printf(
      "| bodies | budget, 1e9 mode-samples/s | taken | p50 | p99 | p99.9 | worst | p99.9 of the deadline | strikes | not played in time |\n"
      "|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  constexpr double kAll = std::numeric_limits<double>::infinity();
  for (const auto& [bodies, budget] : {std::pair{1, kAll}, {20, kAll}, {200, kAll}, {200, 5e8}}) run(bodies, budget, quick ? 0.3 : 20.0);
  return 0;
}

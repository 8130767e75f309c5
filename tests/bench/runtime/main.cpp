// Throughput of modes: voices in blocks of 128 frames against the processor's multiply-add limit, measured in the same run.
//
// usage: bench_runtime [--quick]       prints the tables of docs/reports/performance-runtime.md
//
// Method:     a mode-sample is one mode advanced and summed for one sample; an exact linear form takes at least two multiply-adds for it,
//             so the limit is half the lanes of multiply-adds per second. Limit and voices alternate, CPU time of the thread, medians.
// Source:     docs/decisions/resonator-kernel.md.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "tests/bench/runtime/fma_limit.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace {

using namespace carillon;

constexpr double kRate = 48000.0;
constexpr std::size_t kFrames = 128;
constexpr std::size_t kBlocksPerReading = 64;

double calc_median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Modes that ring for ever, 50 Hz to 20 kHz: nothing is culled.
std::shared_ptr<const synth::Model> make_model(int modes, int number) {
  std::vector<testing::InventedMode> invented;
  for (int m = 0; m < modes; ++m) invented.push_back({50.0 * std::pow(400.0, (m + 0.1 * number) / (modes + 1.0)), 0.0, 1e-3});
  return synth::Model::make(testing::make_cube_bank(invented), {.rate_hz = kRate});
}

/// Voices that share models in turn, all struck.
std::vector<std::unique_ptr<synth::ResonatorBank>> make_voices(const std::vector<std::shared_ptr<const synth::Model>>& models, int voices,
                                                               synth::Isa isa) {
  std::vector<std::unique_ptr<synth::ResonatorBank>> made;
  std::array<float, kFrames> block{};
  for (int i = 0; i < voices; ++i) {
    made.push_back(std::make_unique<synth::ResonatorBank>(models[static_cast<std::size_t>(i) % models.size()],
                                                          synth::ResonatorOptions{.max_strikes = 1, .isa = isa}));
    made.back()->strike({.impulse_n_s = {0.0, 0.0, 1e-6}});  // within the linear range: no watch on deflections
    made.back()->process(block);
  }
  return made;
}

/// Mode-samples per second of CPU time, for at least `seconds` of it. The clock is a call of the system, which takes as long as 60 modes
/// and more: it is read once in kBlocksPerReading blocks.
double measure(std::vector<std::unique_ptr<synth::ResonatorBank>>& voices, double seconds) {
  std::array<float, kFrames> block{};
  double mode_samples = 0.0;
  const double started = base::get_thread_cpu_s();
  double spent = 0.0;
  while (spent < seconds) {
    for (std::size_t blocks = 0; blocks < kBlocksPerReading; blocks += voices.size()) {
      for (auto& voice : voices) {
        block.fill(0.0F);
        voice->process(block);
        mode_samples += static_cast<double>(voice->get_active_mode_count()) * kFrames;
      }
    }
    spent = base::get_thread_cpu_s() - started;
  }
  return mode_samples / spent;
}

struct Result {
  double limit, rate, share;  // mode-samples per second; medians, the share of each round's own pair
};

Result compare(synth::Isa isa, const std::vector<std::shared_ptr<const synth::Model>>& models, int voices, int rounds, double seconds) {
  std::vector<std::unique_ptr<synth::ResonatorBank>> made = make_voices(models, voices, isa);
  measure(made, seconds);
  std::vector<double> limits, rates, shares;
  for (int round = 0; round < rounds; ++round) {
    limits.push_back(0.5 * bench::measure_fma_lanes_per_s(isa, seconds));
    rates.push_back(measure(made, seconds));
    shares.push_back(rates.back() / limits.back());
  }
  return {calc_median(limits), calc_median(rates), calc_median(shares)};
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  const int rounds = quick ? 1 : 7;
  const double seconds = quick ? 0.01 : 0.1;
  std::vector<synth::Isa> isas;
  for (const synth::Isa isa : {synth::Isa::kAvx512, synth::Isa::kAvx2, synth::Isa::kSse4}) {
    if (synth::get_kernels(isa).isa == isa) isas.push_back(isa);
  }
  std::printf("One voice, blocks of %zu frames:\n\n", kFrames);
  std::printf(
      "| instructions | modes | limit, 1e9 mode-samples/s | voice | of the limit | modes in real time at 48 kHz "
      "|\n|---|--:|--:|--:|--:|--:|\n");
  for (const synth::Isa isa : isas) {
    for (const int modes : {256, 1024, 4096}) {
      const Result r = compare(isa, {make_model(modes, 0)}, 1, rounds, seconds);
      std::printf("| %s | %d | %.1f | %.1f | %.0f %% | %.0f |\n", synth::get_name(isa), modes, 1e-9 * r.limit, 1e-9 * r.rate,
                  100.0 * r.share, r.rate / kRate);
    }
  }
  std::printf(
      "\nMany voices:\n\n| instructions | voices x modes | models | memory of states + tables, MB | modes in real time at 48 kHz "
      "|\n|---|--:|--:|--:|--:|\n");
  const int bodies = quick ? 8 : 512;
  for (const synth::Isa isa : isas) {
    for (const int shared : {4, bodies}) {
      std::vector<std::shared_ptr<const synth::Model>> models;
      double bytes = 0.0;
      for (int i = 0; i < shared; ++i) {
        models.push_back(make_model(1000, i));
        bytes += 63.0 * (sizeof(synth::SoundTable) + sizeof(synth::RotationTable));
      }
      bytes += 63.0 * sizeof(synth::ModeState) * bodies;
      const Result r = compare(isa, models, bodies, rounds, seconds);
      std::printf("| %s | %d x 1000 | %d | %.0f | %.0f |\n", synth::get_name(isa), bodies, shared, 1e-6 * bytes, r.rate / kRate);
    }
  }
  return 0;
}

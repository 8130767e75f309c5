// Cost of the watch on deflections beyond the range of linear modes.
//
// usage: bench_bending [--quick]       prints the table of docs/reports/performance-runtime.md
//
// Method:     two voices of one box, one of them with a bank of the kind that is not judged (a membrane); both get the same strikes of 1 ms
//             and play the same second in turns. CPU time of the thread; the median of the ratios of the rounds.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace {

using namespace carillon;

constexpr double kRateHz = 48000.0;
constexpr int kBlocks = 375;  // of 128 frames: a second

struct Case {
  const char* name;
  double impulse_n_s;
  int every;  // blocks between two strikes
};

struct Played {
  double cpu_s = 0.0, sum = 0.0, deflection = 0.0;
};

Played play(const std::shared_ptr<const synth::Model>& model, const Case& one) {
  synth::ResonatorBank voice(model, {.max_strikes = 8});
  std::array<float, 128> block{};
  Played played;
  const double began_s = base::get_thread_cpu_s();
  for (int b = 0; b < kBlocks; ++b) {
    if (b % one.every == 0)
      voice.strike({.time_s = (b + 0.5) * 128.0 / kRateHz,
                    .triangle = 3,
                    .barycentric = {0.3, 0.3, 0.4},
                    .impulse_n_s = {0.0, one.impulse_n_s, 0.0},
                    .duration_s = 1e-3});
    block.fill(0.0F);
    voice.process(block);
    for (const float x : block) played.sum += std::abs(static_cast<double>(x));
  }
  played.cpu_s = base::get_thread_cpu_s() - began_s;
  played.deflection = voice.get_counters().deflection;
  return played;
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  std::printf(
      "| strikes | modes | largest deflection, thicknesses | CPU time of a second without, ms | with, ms | ratio "
      "|\n|---|--:|--:|--:|--:|--:|\n");
  for (const Case& one : {Case{"ten a second, soft", 0.01, 37}, Case{"ten a second, hard", 10.0, 37},
                          Case{"in every block, soft", 0.001, 1}, Case{"in every block, hard", 10.0, 1}})
    for (const std::size_t modes : {256U, 1024U}) {
      bank::Bank bank = bank::example::make_bank(16, modes);
      const auto judged = synth::Model::make(bank, {.rate_hz = kRateHz});
      bank.element = "analytic", bank.provenance = R"({"body": {"membrane": {}}})";
      const auto plain = synth::Model::make(bank, {.rate_hz = kRateHz});
      std::vector<double> ratios, seconds;
      double deflection = 0.0;
      for (int round = 0; round < (quick ? 1 : 41); ++round) {
        Played with, without;
        for (const int turn : {round % 2, 1 - round % 2}) (turn == 0 ? with : without) = play(turn == 0 ? judged : plain, one);
        if (with.sum != without.sum || without.deflection != 0.0) {
          std::fprintf(stderr, "bench_bending: the watch changes the sound, or the membrane is judged\n");
          return 1;
        }
        deflection = with.deflection;
        ratios.push_back(with.cpu_s / without.cpu_s), seconds.push_back(without.cpu_s);
      }
      for (std::vector<double>* values : {&ratios, &seconds}) std::sort(values->begin(), values->end());
      const double without_s = seconds[seconds.size() / 2], ratio = ratios[ratios.size() / 2];
      std::printf("| %s | %zu | %.2g | %.1f | %.1f | %.3g |\n", one.name, modes, deflection, 1e3 * without_s, 1e3 * without_s * ratio,
                  ratio);
    }
  return 0;
}

// A driven bank against rivals that were built for the same modes: interleaved, in one process, on the same noise.
//
// usage: bench_driven MODES --write              prints a1 a2 gain of each mode, for what builds the rivals (tests/bench/runtime/rivals)
//        bench_driven MODES SECONDS NAME=LIBRARY...   prints a table; a library has rival_init() and rival_process(int, const float*,
//        float*)
//
// Method:     all add the pressure of 128 samples of noise a call; before the clock runs their sounds are compared, 1e-3 of it at most.
//             Medians of the rounds' CPU times. Then ours in calls of a quantum, by the clock.
// Source:     none.
// Deviations: none.
#include <dlfcn.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "runtime/base/cpu_clock.hpp"
#include "runtime/synth/driven_bank.hpp"
#include "tests/bench/runtime/fma_limit.hpp"
#include "tests/synth/cube_bank.hpp"

namespace {

using namespace carillon;

constexpr double kRate = 48000.0;
constexpr int kFrames = 128;
constexpr int kRounds = 9;

struct Mode {
  double freq_hz, decay_per_s;
};

/// As dense in frequency as those of solid bodies: even steps from 40 Hz to 20 kHz.
std::vector<Mode> make_modes(int count) {
  std::vector<Mode> modes;
  for (int m = 0; m < count; ++m) {
    const double freq = 40.0 + (20000.0 - 40.0) * m / count;
    modes.push_back({freq, 3.0 + 1e-6 * freq * freq});
  }
  return modes;
}

/// A force that is held over each sample, to g q' with g = 1e4 and phi = 1, as a recursion of two past values on the changes of the force.
void write_coefficients(const std::vector<Mode>& modes) {
  const double h = 1.0 / kRate;
  for (const Mode& mode : modes) {
    const double omega = 2.0 * std::numbers::pi * mode.freq_hz;
    const std::complex<double> root(-mode.decay_per_s, std::sqrt(omega * omega - mode.decay_per_s * mode.decay_per_s));
    const std::complex<double> turn = std::exp(root * h);
    std::printf("%.17g %.17g %.17g\n", 2.0 * turn.real(), -std::norm(turn), 1e4 * turn.imag() / root.imag());
  }
}

struct Player {
  std::string name;
  std::function<void(const float*, float*)> process;
  std::vector<double> seconds;  // per round
};

Player load(const std::string& what) {
  const std::size_t equals = what.rfind('=');
  const std::string file = what.substr(equals + 1);
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library) {
    std::fprintf(stderr, "%s\n", dlerror());
    std::exit(2);
  }
  reinterpret_cast<void (*)()>(dlsym(library, "rival_init"))();
  const auto process = reinterpret_cast<void (*)(int, const float*, float*)>(dlsym(library, "rival_process"));
  return {what.substr(0, equals), [process](const float* in, float* out) { process(kFrames, in, out); }, {}};
}

double calc_median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Medians of the time of calls of a quantum [s]: those that end a period, and the others. Without what asking for the time takes.
std::pair<double, double> calc_call_times(synth::DrivenBank& bank, const std::vector<float>& noise) {
  std::vector<double> last, other, nothing;
  std::vector<float> out(synth::kQuantum);
  for (int i = 0; i < 40000; ++i) {
    const auto now = std::chrono::steady_clock::now();
    const auto started = std::chrono::steady_clock::now();
    bank.process(std::span(noise).subspan(static_cast<std::size_t>(i % synth::kQuanta) * synth::kQuantum, synth::kQuantum), out);
    const auto ended = std::chrono::steady_clock::now();
    nothing.push_back(std::chrono::duration<double>(started - now).count());
    (i % synth::kQuanta == synth::kQuanta - 1 ? last : other).push_back(std::chrono::duration<double>(ended - started).count());
  }
  const double empty = calc_median(nothing);
  return {calc_median(last) - empty, calc_median(other) - empty};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const int count = std::atoi(argv[1]);
  const std::vector<Mode> modes = make_modes(count);
  if (std::strcmp(argv[2], "--write") == 0) {
    write_coefficients(modes);
    return 0;
  }
  const double seconds = std::atof(argv[2]);
  std::vector<testing::InventedMode> invented;
  for (const Mode& mode : modes) invented.push_back({mode.freq_hz, mode.decay_per_s, 1e4});
  const auto model = synth::Model::make(testing::make_cube_bank(invented), {.rate_hz = kRate});

  std::vector<Player> players;
  std::vector<std::unique_ptr<synth::DrivenBank>> banks;
  for (const synth::Isa isa : {synth::Isa::kAvx512, synth::Isa::kAvx2, synth::Isa::kSse2}) {
    if (synth::get_kernels(isa).isa != isa) continue;
    banks.push_back(std::make_unique<synth::DrivenBank>(*model, 0, carillon::Vec3{1, 0, 0}, carillon::Vec3{0, 0, 1}, isa));
    players.push_back({std::string("Carillon, ") + synth::get_name(isa),
                       [driven = banks.back().get()](const float* in, float* out) {
                         std::fill_n(out, kFrames, 0.0F);
                         driven->process(std::span(in, kFrames), std::span(out, kFrames));
                       },
                       {}});
  }
  for (int i = 3; i < argc; ++i) players.push_back(load(argv[i]));

  std::mt19937 random(1);
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  std::vector<float> noise(16 * kFrames), ours(noise.size()), theirs(noise.size());
  for (float& x : noise) x = number(random);
  for (Player& player : players) {
    std::vector<float>& out = &player == players.data() ? ours : theirs;
    for (std::size_t n = 0; n < noise.size(); n += kFrames) player.process(&noise[n], &out[n]);
    double error = 0.0, size = 0.0;
    for (std::size_t n = 0; n < noise.size() && &player != players.data(); ++n) {
      error += (ours[n] - theirs[n]) * (ours[n] - theirs[n]), size += ours[n] * ours[n];
    }
    if (error > 1e-6 * size) {
      std::fprintf(stderr, "%s sounds different: %.1e of the sound\n", player.name.c_str(), std::sqrt(error / size));
      return 1;
    }
  }

  std::vector<float> out(kFrames);
  for (int round = 0; round < kRounds; ++round) {
    for (Player& player : players) {
      const double started = base::get_thread_cpu_s();
      double spent = 0.0;
      long blocks = 0;
      while (spent < seconds) {
        for (std::size_t n = 0; n < noise.size(); n += kFrames, ++blocks) player.process(&noise[n], out.data());
        spent = base::get_thread_cpu_s() - started;
      }
      player.seconds.push_back(spent / static_cast<double>(blocks));
    }
  }
  const double own = calc_median(players[0].seconds);
  std::printf("| %d modes, one force, blocks of %d | 1e9 mode-samples/s | times ours |\n|---|--:|--:|\n", count, kFrames);
  for (const Player& player : players) {
    const double block = calc_median(player.seconds);
    std::printf("| %s | %.2f | %.1f |\n", player.name.c_str(), 1e-9 * count * kFrames / block, block / own);
  }
  const auto [last, other] = calc_call_times(*banks.front(), noise);
  std::printf("\nCalls of %d samples: %.2f us at the end of a period, %.2f us else.\n", synth::kQuantum, 1e6 * last, 1e6 * other);
  return 0;
}

// A scene of struck bodies that ring and no more, as a library that bench_off_is_free loads twice: once with every effect compiled in, once
// with only these two.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace {

using namespace carillon;

constexpr double kRate = 48000.0;
constexpr int kFrames = 128;
constexpr int kBodies = 20, kModes = 100;
constexpr double kStrikesPerS = 10.0;
constexpr synth::EffectSet kCalledFor{synth::Effect::kModal, synth::Effect::kHertzPulse};

struct Scene {
  synth::Synthesiser synthesiser{{.rate_hz = kRate, .max_bodies = kBodies, .longest_m = 10.0}};
  std::mt19937 random{1};
  std::exponential_distribution<double> gap{kStrikesPerS * kBodies};
  std::uniform_real_distribution<double> unit{0.0, 1.0};
  double next_s = 0.0;
  std::uint64_t sum = 0;

  Scene() {
    std::vector<testing::InventedMode> modes;
    for (int m = 0; m < kModes; ++m) modes.push_back({80.0 * std::pow(200.0, m / 100.0), 2.0 + 0.4 * m, 1e-3, {0.5, 0.3, 1.0}, 0.1});
    const auto model = synth::Model::make(testing::make_cube_bank(modes), {.rate_hz = kRate});
    for (int b = 0; b < kBodies; ++b) synthesiser.add_body(model, {.position_m = {0.1 * b, 2.0, 0.0}, .effects = kCalledFor});
  }
};

std::unique_ptr<Scene> g_scene;

}  // namespace

#define CARILLON_VISIBLE extern "C" __attribute__((visibility("default")))

/// CPU seconds that the next `blocks` blocks take. `sum`: of all bits heard so far.
CARILLON_VISIBLE double carillon_bench_play(int blocks, std::uint64_t* sum) {
  if (g_scene == nullptr) g_scene = std::make_unique<Scene>();
  Scene& scene = *g_scene;
  std::array<float, kFrames> left{}, right{};
  const std::array<float*, 2> out{left.data(), right.data()};
  double spent = 0.0;
  for (int block = 0; block < blocks; ++block) {
    for (const double ahead_s = scene.synthesiser.get_time_s() + 0.01; scene.next_s < ahead_s; scene.next_s += scene.gap(scene.random)) {
      scene.synthesiser.push(events::Impulse{.time_s = scene.next_s,
                                             .body = static_cast<int>(scene.unit(scene.random) * kBodies),
                                             .triangle = static_cast<int>(12 * scene.unit(scene.random)),
                                             .impulse_n_s = {0.0, 1e-4, 1e-3 * scene.unit(scene.random)},
                                             .duration_s = 5e-5 + 2e-4 * scene.unit(scene.random)});
    }
    const double started = base::get_thread_cpu_s();
    scene.synthesiser.process(out.data(), 2, kFrames);
    spent += base::get_thread_cpu_s() - started;
    for (const float x : left) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, &x, sizeof bits);
      scene.sum = scene.sum * 31 + bits;
    }
  }
  *sum = scene.sum;
  return spent;
}

/// Whether this build refuses an effect with a message that names it and the option.
CARILLON_VISIBLE int carillon_bench_refuses(int effect) {
  try {
    synth::check_compiled({static_cast<synth::Effect>(effect)});
    return 0;
  } catch (const InputError& error) {
    const std::string message = error.what();
    const bool names = message.find(synth::get_name(static_cast<synth::Effect>(effect))) != std::string::npos;
    return names && message.find("CARILLON_EFFECTS") != std::string::npos ? 1 : 0;
  }
}

// Cost of directivity, ground reflection and sensors: a body of 228 modes that rings, heard by two ears.
//
// usage: bench_directivity [--quick]       prints the figures of docs/reports/performance-runtime.md
//
// Method:     modes from 0.8 to 20 kHz in even steps of pitch, of orders as the bunny has them (L = k R + 4, R = 84 mm); the body stands
//             still or turns at 1 or 10 rad/s. The median and the 99.9 % quantile of the CPU time of a block of 128 samples, the first
//             blocks, in which everything sets in, left out.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstring>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"
#include "tests/unit/runtime/synth/multipole_cube.hpp"

namespace {

using namespace carillon;
using synth::Effect;
constexpr double kRate = 48000.0, kRadius = 0.0842;
constexpr int kModes = 228;

bank::Bank make_bank() {
  std::vector<testing::InventedMode> modes;
  std::vector<testing::ModeMultipoles> multipoles;
  std::mt19937 random(1);
  std::normal_distribution<double> number;
  for (int m = 0; m < kModes; ++m) {
    const double freq_hz = 834.0 * std::pow(19978.0 / 834.0, m / (kModes - 1.0));
    modes.push_back({freq_hz, 0.5, 1e-2, {0.3, -0.2, 1.0}, 0.1});
    const int order = static_cast<int>(2.0 * std::numbers::pi * freq_hz / bank::kSoundSpeedMs * kRadius) + 4;
    testing::ModeMultipoles own(static_cast<std::size_t>((order + 1) * (order + 1)));
    for (auto& a : own) a = {number(random), number(random)};
    multipoles.push_back(own);
  }
  bank::Bank bank = testing::make_cube_bank(modes);
  testing::give_multipoles(bank, multipoles, kRadius);
  return bank;
}

/// `extra_ears`, `sensors`: in addition to two ears. Returns the median [us].
double play(const char* name, const std::shared_ptr<const synth::Model>& model, synth::EffectSet effects, double turn_rad_s, int blocks,
            int extra_ears = 0, int sensors = 0) {
  synth::SynthesiserOptions options{.rate_hz = kRate, .max_waypoints = 512};
  for (int i = 0; i < extra_ears; ++i) options.microphones_m.push_back({0.0, 0.1 * (i + 1), 0.2});
  options.floor = synth::Floor{.point_m = {0.0, 0.0, -1.0}};
  synth::Synthesiser synthesiser(options);
  const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.5, 0.0}, .effects = effects});
  for (int i = 0; i < sensors; ++i) synthesiser.add_sensor(body, make_bank(), {.triangle = i});
  synthesiser.push(events::Impulse{.time_s = 0.001, .body = body, .impulse_n_s = {0.0, 0.0, 1.0}});
  std::array<float, synth::kBlock> left{}, right{};
  const std::array<float*, 2> out{left.data(), right.data()};
  std::vector<double> spent;
  double pushed_s = 0.0;
  for (int block = 0; block < blocks; ++block) {
    for (; turn_rad_s > 0.0 && pushed_s < synthesiser.get_time_s() + 0.05; pushed_s += 0.01) {
      const double half = 0.5 * turn_rad_s * pushed_s;
      synthesiser.push(
          events::BodyMotion{pushed_s, body, {0.0, 1.5, 0.0}, {}, {std::cos(half), 0.6 * std::sin(half), 0.0, 0.8 * std::sin(half)}});
    }
    const double begin = base::get_thread_cpu_s();
    synthesiser.process(out.data(), 2, synth::kBlock);
    if (block >= 20) spent.push_back(1e6 * (base::get_thread_cpu_s() - begin));
  }
  std::sort(spent.begin(), spent.end());
  const auto pick = [&](double share) { return spent[share * (static_cast<double>(spent.size()) - 1.0)]; };
  std::printf("%-52s %7.1f us  99.9 %%: %7.1f us  looked up a block: %6.1f\n", name, pick(0.5), pick(0.999),
              static_cast<double>(synthesiser.get_effect_counters(body).units[Effect::kDirectivity]) / blocks);
  return pick(0.5);
}

/// Price of one sensor, of several in one run, over that of a microphone with directivity.
void compare_sensors(const std::shared_ptr<const synth::Model>& model, synth::EffectSet plain, synth::EffectSet directed, int blocks) {
  constexpr int kMore = 4;
  const double bare = play("still", model, plain, 0.0, blocks), sensed = play("still, 4 sensors", model, plain, 0.0, blocks, 0, kMore);
  const double two = play("still, directivity", model, directed, 0.0, blocks);
  const double more = play("still, directivity, 4 more microphones", model, directed, 0.0, blocks, kMore);
  const double sensor = (sensed - bare) / kMore, microphone = (more - two) / kMore;
  std::printf("%-52s %7.2f us, a microphone with directivity: %.2f us, ratio %.2f\n", "one sensor", sensor, microphone,
              sensor / microphone);
}

}  // namespace

int main(int argc, char** argv) {
  const int blocks = argc > 1 && std::strcmp(argv[1], "--quick") == 0 ? 100 : 3000;
  const auto model = synth::Model::make(make_bank(), {.rate_hz = kRate});
  const synth::EffectSet plain = synth::kDefaultEffects, directed = plain.with(Effect::kDirectivity);
  std::printf("%d modes, two ears, a block of 128 samples, median\n", model->get_mode_count());
  play("still", model, plain, 0.0, blocks);
  play("still, ground_reflection", model, plain.with(Effect::kGroundReflection), 0.0, blocks);
  play("still, directivity", model, directed, 0.0, blocks);
  play("turning at 10 rad/s", model, plain, 10.0, blocks);
  play("turning at 1 rad/s, directivity", model, directed, 1.0, blocks);
  play("turning at 10 rad/s, directivity", model, directed, 10.0, blocks);
  play("turning at 10 rad/s, directivity, ground_reflection", model, directed.with(Effect::kGroundReflection), 10.0, blocks);
  compare_sensors(model, plain, directed, blocks);
  return 0;
}

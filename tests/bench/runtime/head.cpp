// What a head costs for one source: EarFilter::process, both ears, in blocks of 128 and of 32 samples, while the source stands still and
// while it goes round; and what 20 bodies cost in a scene with free ears and with a head, still and moving.
//
// usage: bench_head [--quick] [SOFA]     the sphere, and the head of the file
//
// Method:     noise; CPU time of a second of sound, the least of the rounds. The bodies have 30 modes each that ring for ever.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <random>
#include <span>
#include <vector>

#include "runtime/acoustics/head/ear_filter.hpp"
#include "runtime/acoustics/head/sofa.hpp"
#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace {

using namespace carillon;

constexpr double kRate = 48000.0;

/// CPU time of a sample [ns].
double measure(const std::shared_ptr<const head::Head>& head, std::size_t size, bool turns, int rounds) {
  std::mt19937 chance(1);
  std::normal_distribution<double> normal;
  std::vector<double> input(size), left(size), right(size);
  for (double& value : input) value = normal(chance);
  head::EarFilter filter(head);
  const int blocks = static_cast<int>(kRate / static_cast<double>(size));
  double least = 1e9;
  for (int round = 0; round < rounds; ++round) {
    const double started = base::get_thread_cpu_s();
    for (int block = 0; block < blocks; ++block) {
      const double angle = turns ? 6.28 * block / blocks : 0.7;
      filter.process({std::cos(angle), std::sin(angle), 0.3}, input, left, right);
    }
    least = std::min(least, base::get_thread_cpu_s() - started);
  }
  if (!std::isfinite(left[0])) std::puts("not finite");
  return 1e9 * least / (blocks * static_cast<double>(size));
}

void print(const char* name, const std::shared_ptr<const head::Head>& head, int rounds) {
  for (const std::size_t size : {std::size_t{128}, std::size_t{32}}) {
    const double still = measure(head, size, false, rounds), turning = measure(head, size, true, rounds);
    std::printf("%-8s %4d taps, blocks of %3zu: %5.1f ns a sample standing still, %5.1f ns going round\n", name, head->get_taps(), size,
                still, turning);
  }
}

/// CPU time of a sample of all bodies [ns].
double measure_scene(synth::EffectSet effects, bool moves, const std::shared_ptr<const head::Head>& head, int rounds) {
  constexpr int kBodies = 20, kBlock = 128;
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 30; ++m) modes.push_back({200.0 + 300.0 * m, 0.0, 0.01});
  const auto model = synth::Model::make(testing::make_cube_bank(modes), {.rate_hz = kRate});
  const std::vector<Vec3> ears{{-0.0875, 0.0, 0.0}, {0.0875, 0.0, 0.0}};
  synth::Synthesiser synthesiser({.rate_hz = kRate,
                                  .microphones_m = ears,
                                  .floor = synth::Floor{.point_m = {0.0, 0.0, -1.0}},
                                  .head = synth::ListeningHead{head, synth::calc_level_head_rotation(ears[0], ears[1])}});
  for (int b = 0; b < kBodies; ++b) {
    const Vec3 place{-2.0 + 0.2 * b, 1.5, 0.0};
    const int body = synthesiser.add_body(model, {.position_m = place, .effects = effects});
    synthesiser.push(events::Impulse{.time_s = 0.01, .body = body, .impulse_n_s = {0.0, 0.0, 1.0}});
    if (!moves) continue;
    synthesiser.push(events::BodyMotion{0.0, body, place, {0.05, 0.0, 0.0}});
    synthesiser.push(events::BodyMotion{60.0, body, place + Vec3{3.0, 0.0, 0.0}, {0.05, 0.0, 0.0}});
  }
  std::vector<float> left(kBlock), right(kBlock);
  float* const out[2] = {left.data(), right.data()};
  const auto play = [&](int blocks) {
    for (int block = 0; block < blocks; ++block) synthesiser.process(out, 2, kBlock);
  };
  play(40);
  constexpr int kBlocks = 375;  // a second
  double least = 1e9;
  for (int round = 0; round < rounds; ++round) {
    const double started = base::get_thread_cpu_s();
    play(kBlocks);
    least = std::min(least, base::get_thread_cpu_s() - started);
  }
  if (!std::isfinite(left[0]) || left[0] == 0.0F) std::puts("no sound");
  return 1e9 * least / (kBlocks * kBlock);
}

void print_scene(const char* name, const std::shared_ptr<const head::Head>& head, int rounds) {
  for (const bool moves : {false, true}) {
    for (const bool reflects : {false, true}) {
      const synth::EffectSet effects = reflects ? synth::kDefaultEffects.with(synth::Effect::kGroundReflection) : synth::kDefaultEffects;
      const double free = measure_scene(effects, moves, head, rounds),
                   by_head = measure_scene(effects.with(synth::Effect::kHead), moves, head, rounds);
      std::printf("20 bodies, %s, %-7s%s: %5.0f ns a sample with free ears, %5.0f ns by the head, %4.1f ns more for each body\n", name,
                  moves ? "moving" : "still", reflects ? " above a floor" : "", free, by_head, (by_head - free) / 20.0);
    }
  }
}

}  // namespace

int main(int count, char** words) {
  const bool is_quick = count > 1 && std::strcmp(words[1], "--quick") == 0;
  const int rounds = is_quick ? 2 : 21;
  const double started = base::get_thread_cpu_s();
  const auto sphere = head::make_sphere(kRate);
  std::printf("sphere made in %.1f ms\n", 1e3 * (base::get_thread_cpu_s() - started));
  print("sphere", sphere, rounds);
  print_scene("sphere", sphere, rounds);
  if (count > (is_quick ? 2 : 1)) {
    const double before = base::get_thread_cpu_s();
    const auto measured = head::read_sofa(words[count - 1], kRate);
    std::printf("%zu responses read in %.1f ms\n", measured->count_responses(), 1e3 * (base::get_thread_cpu_s() - before));
    print("SOFA", measured, rounds);
    print_scene("SOFA", measured, rounds);
  }
}

// Method:     pieces of the synthesiser run by themselves on a made-up body, each a fraction of a millisecond, on the clock of the thread;
//             the fastest of three rounds, since other work only ever slows.
// Source:     none.
// Deviations: caches are warm, so a scene of hundreds of banks costs more.
#include "runtime/scene/effects/costs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/synth/acceleration_noise.hpp"
#include "runtime/synth/head_ears.hpp"
#include "runtime/synth/receiver.hpp"
#include "runtime/synth/voice.hpp"

namespace carillon::effects {
namespace {

constexpr double kRateHz = 48000.0;
constexpr int kBlock = synth::kBlock;
constexpr int kBlocks = 32;

/// The fastest of three, ns.
template <typename Function>
double time_ns(Function function) {
  double best = 1e300;
  for (int round = 0; round < 3; ++round) {
    const double begin = base::read_clock_ns(CLOCK_THREAD_CPUTIME_ID);
    function();
    best = std::min(best, base::read_clock_ns(CLOCK_THREAD_CPUTIME_ID) - begin);
  }
  return best;
}

/// One triangle; modes that do not decay.
std::shared_ptr<const synth::Model> make_model(int modes) {
  bank::Bank bank;
  bank.vertices_m = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}};
  bank.triangles = {{0, 1, 2}};
  for (int m = 0; m < modes; ++m) {
    const double omega = 2.0 * std::numbers::pi * 200.0 * std::pow(100.0, static_cast<double>(m) / modes);
    bank.eigenvalue_rad2_s2.push_back(omega * omega);
    bank.decay_per_s.push_back(1e-3);
    bank.radiation_gain.push_back(1e-2);
    bank.shape_scale.push_back(1.0 / 32767.0);
  }
  bank.shape.assign(3 * static_cast<std::size_t>(modes) * 3, 20000);
  return synth::Model::make(bank, {.rate_hz = kRateHz});
}

/// One block of a voice that rings, ns; `strikes` blows of `duration_s` in each.
double time_voice(int modes, int strikes, double duration_s) {
  synth::Voice voice(make_model(modes), {.max_strikes = 1024});
  std::array<float, kBlock> block{};
  std::int64_t sample = 0;
  const auto play = [&] {
    for (int b = 0; b < kBlocks; ++b, sample += kBlock) {
      for (int k = 0; k < strikes; ++k) {
        voice.strike({.time_s = static_cast<double>(sample + kBlock / 2) / kRateHz, .impulse_n_s = {0, 0, 1e-3}, .duration_s = duration_s});
      }
      voice.process(block);
    }
  };
  voice.strike({.time_s = 1e-4, .impulse_n_s = {0, 0, 1e-2}});
  play();
  return time_ns(play) / kBlocks;
}

/// The same with a force of so many steps in each block.
double time_force(int modes, int steps, double length_s) {
  synth::Voice voice(make_model(modes), {.max_forces = 1024});
  std::array<float, kBlock> block{};
  std::int64_t sample = 0;
  events::Force force{.step_s = length_s / steps, .count = static_cast<std::int16_t>(steps)};
  for (int k = 0; k < steps; ++k) force.impulse_n_s[k] = {0.0F, 0.0F, 1e-3F / static_cast<float>(steps)};
  const auto play = [&] {
    for (int b = 0; b < kBlocks; ++b, sample += kBlock) {
      force.time_s = static_cast<double>(sample + kBlock / 4) / kRateHz;
      voice.push(force);
      voice.process(block);
    }
  };
  play();
  return time_ns(play) / kBlocks;
}

double time_ear(bool moves, bool has_dipoles) {
  synth::Trajectory track(64), listener(1);
  track.push({.position_m = {0, 2, 0}});
  if (moves) track.push({.time_s = 10.0, .position_m = {0, 12, 0}, .velocity_m_s = {0, 1, 0}});
  listener.push({});
  std::array<std::unique_ptr<synth::DelayLine>, 4> sent;
  for (auto& history : sent) history = std::make_unique<synth::DelayLine>(10.0, kRateHz, kBlock);
  synth::Source source{.track = &track, .monopole = sent[0].get()};
  if (has_dipoles) source.dipole = {sent[1].get(), sent[2].get(), sent[3].get()};
  synth::Receiver ear({}, kRateHz);
  std::array<float, kBlock> noise{};
  for (std::size_t n = 0; n < noise.size(); ++n) noise[n] = static_cast<float>(std::sin(0.7 * static_cast<double>(n)) + 0.01);
  std::array<double, kBlock> heard{};
  std::int64_t sample = 0;
  const auto play = [&](bool listens) {
    for (int b = 0; b < kBlocks; ++b, sample += kBlock) {
      for (auto& history : sent) history->push(noise);
      if (listens) ear.process(source, listener, sample, heard);
    }
  };
  play(true);
  const double with = time_ns([&] { play(true); }), without = time_ns([&] { play(false); });
  return std::max(0.0, with - without) / kBlocks;
}

/// A head's ears, ns a block.
double time_head(bool moves) {
  synth::HeadEars ears(head::make_sphere(kRateHz));
  std::array<double, synth::kSubBlock> sound{}, left{}, right{};
  for (std::size_t n = 0; n < sound.size(); ++n) sound[n] = std::sin(0.7 * static_cast<double>(n));
  double angle = 0.3;
  return time_ns([&] {
           for (int b = 0; b < kBlocks * synth::kSubBlocks; ++b) {
             if (moves) angle += 1e-3;
             ears.process({std::cos(angle), std::sin(angle), 0.1}, sound, left, right);
           }
         }) /
         kBlocks;
}

double time_click() {
  synth::AccelerationNoise click(0.02, 0.01, kRateHz);
  std::array<std::array<float, kBlock>, 3> blocks{};
  std::int64_t sample = 0;
  return time_ns([&] {
           for (int b = 0; b < kBlocks; ++b, sample += kBlock) {
             click.strike({.time_s = static_cast<double>(sample) / kRateHz, .impulse_n_s = {0, 0, 1e-2}, .duration_s = 1e-4}, {1, 0, 0, 0});
             click.process({blocks[0], blocks[1], blocks[2]});
           }
         }) /
         kBlocks;
}

}  // namespace

Costs measure_costs() {
  constexpr int kFew = 64, kMany = 320;
  constexpr double kLongS = 0.5 * kBlock / kRateHz;
  Costs costs;
  const auto share = [](double ns, double of) { return std::max(0.0, ns) / of; };
  const double few = time_voice(kFew, 0, 0.0), many = time_voice(kMany, 0, 0.0);
  costs.mode_sample_ns = share(many - few, (kMany - kFew) * kBlock);
  costs.voice_sample_ns = share(few - costs.mode_sample_ns * kFew * kBlock, kBlock);
  constexpr double kShortS = 2.0 / kRateHz;
  const double struck = time_voice(kMany, 1, 0.0), tapped = time_voice(kMany, 1, kShortS), pushed = time_voice(kMany, 1, kLongS);
  costs.strike_mode_ns = share(struck - many, kMany);
  costs.pulse_mode_sample_ns = share(pushed - tapped, kMany * (kLongS - kShortS) * kRateHz);
  costs.pulse_mode_ns = share(tapped - struck, kMany);
  constexpr int kSteps = events::kMaxForceSteps;
  const double touched = time_force(kMany, 1, kShortS), stepped = time_force(kMany, kSteps, kShortS);
  costs.step_mode_ns = share(stepped - touched, kMany * (kSteps - 1));
  const double few_touched = time_force(kFew, 1, kShortS) - few;
  costs.force_mode_ns = share(touched - many - few_touched, kMany - kFew);
  costs.event_ns = share(few_touched - costs.force_mode_ns * kFew, 1.0);
  costs.ear_sample_ns = share(time_ear(false, false), kBlock);
  costs.moving_ear_sample_ns = std::max(costs.ear_sample_ns, share(time_ear(true, false), kBlock));
  costs.dipole_ear_sample_ns = share(time_ear(false, true) - costs.ear_sample_ns * kBlock, kBlock);
  costs.head_sample_ns = share(time_head(false), kBlock);
  costs.moving_head_sample_ns = std::max(costs.head_sample_ns, share(time_head(true), kBlock));
  costs.click_sample_ns = share(time_click(), kBlock);
  return costs;
}

}  // namespace carillon::effects

// Hard cases of one ringing body: the ends of the band, all regimes of damping, hours without damping, numbers too small and too large.
// Closed forms in long double, and the table of 40-digit values in tests/unit/runtime/synth/data.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/synth/resonator_bank.hpp"
#include "tests/hard/closed_form.hpp"
#include "tests/hard/figure.hpp"
#include "tests/unit/runtime/synth/reference.hpp"

namespace carillon::hard {
namespace {

using synth::Isa;
using synth::Model;
using synth::ResonatorBank;
constexpr double kRate = 48000.0;
constexpr double kPi = std::numbers::pi;

TEST(time, band_ends) {
  for (const double rate : {8000.0, 44100.0, 48000.0, 192000.0}) {
    for (const double freq : {20.0, 0.499 * rate}) {
      for (const double decay : {0.0, 0.02, 0.5}) {
        const Modes modes{{to_lambda(freq), decay}};
        ResonatorBank voice(Model::make(make_bank(modes), {.rate_hz = rate}), {.silence_pa = 1e-30});
        strike(voice);
        const std::string part =
            std::to_string(static_cast<int>(rate)) + " Hz, " + (freq > 20.0 ? "0.499 fs" : "20 Hz") + ", decay " + std::to_string(decay);
        hold("band_ends", calc_error(play(voice, 24000), 0, rate, modes), 2e-6, part);
        const auto minute = static_cast<std::int64_t>(60.0 * rate);
        play(voice, static_cast<std::size_t>(minute - 24000));
        hold("band_ends", calc_error(play(voice, 24000), minute, rate, modes), 2e-6, part + ", after a minute");
      }
    }
  }
}

TEST(time, critical_damping) {
  // 40-digit values of all regimes, two of them 1e-12 off critical damping; at 100 kHz their times are samples.
  for (const auto& row : testing::read_impulse_reference()) {
    const double rate = 100000.0, sample = row.time_s * rate;
    if (std::abs(sample - std::round(sample)) > 1e-9 || sample > 1e6) continue;
    ResonatorBank voice(Model::make(make_bank({{row.lambda, row.decay_per_s()}}), {.rate_hz = rate}), {.silence_pa = 1e-30});
    strike(voice);
    const std::vector<float> heard = play(voice, static_cast<std::size_t>(std::llround(sample)) + 1);
    const double scale = std::max({std::exp(-row.decay_per_s() * row.time_s), std::abs(row.q_dot), 1e-30});
    hold("critical_damping", std::abs(static_cast<double>(heard.back()) - row.q_dot) / scale, 2e-6,
         row.regime + " at " + std::to_string(row.time_s) + " s");
  }
  for (const double freq : {20.0, 880.0, 20000.0}) {
    const double omega = 2.0 * kPi * freq;
    // On both sides of the critical point, and of the place where the voice goes from one form to the other.
    const double change = std::sqrt(1.0 - 0.05 * 0.05);
    for (const double ratio :
         {1.0, 1.0 - 1e-12, 1.0 + 1e-12, 1.0 - 1e-8, 1.0 + 1e-8, 1.0 - 1e-4, 1.0 + 1e-4, change * (1.0 - 1e-9), change * (1.0 + 1e-9)}) {
      const Modes modes{{omega * omega, omega * ratio}};
      ResonatorBank voice(Model::make(make_bank(modes), {.rate_hz = kRate}), {.silence_pa = 1e-30});
      strike(voice);
      hold("critical_damping", calc_error(play(voice, 4800), 0, kRate, modes), 2e-6,
           std::to_string(freq) + " Hz, ratio " + to_json(ratio - 1.0) + " off");
    }
  }
}

TEST(time, over_damping) {
  // A million times critical: the mode follows a push as fast as any step of ours, and creeps back for longer than any sound.
  for (const double ratio : {2.0, 30.0, 1e3, 1e6}) {
    for (const double freq : {20.0, 1000.0, 20000.0}) {
      const double omega = 2.0 * kPi * freq, decay = ratio * omega, length_s = 300e-6;
      ResonatorBank voice(Model::make(make_bank({{omega * omega, decay}}), {.rate_hz = kRate}), {.silence_pa = 1e-300});
      ASSERT_TRUE(voice.strike({.time_s = 0.01 + 0.5 * length_s, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = length_s}));
      const std::vector<float> heard = play(voice, 4800);
      Real largest = 0, peak = 0;
      for (int n = 470; n < 560; ++n) {
        const Real wanted = calc_pushed(omega * omega, decay, n / static_cast<Real>(kRate) - 0.01L, length_s);
        largest = std::max(largest, std::abs(heard[n] - wanted));
        peak = std::max(peak, std::abs(wanted));
      }
      const std::string part = to_json(ratio) + " x critical at " + to_json(freq) + " Hz";
      hold("over_damping", static_cast<double>(largest / peak), 1e-6, part);
      EXPECT_EQ(voice.get_counters().resets, 0);
    }
  }
  // Where the voice gives up following the fast root step by step, a force that never rests makes the same sound on both sides.
  std::vector<std::vector<float>> heard;
  const double change = 2.0 * 256.0 * kRate;  // decay: 4 of the fast root in a 256th of a sample
  for (const double side : {0.999, 1.001}) {
    const auto model = Model::make(make_bank({{to_lambda(1000.0), side * change}}), {.rate_hz = kRate});
    ResonatorBank voice(model);
    synth::ContactForces contacts(model, {});
    voice.attach(&contacts);
    for (int k = 0; k < 100; ++k) {
      ASSERT_TRUE(contacts.take({.time_s = 1e-3 * k,
                                 .id = 5,
                                 .state = k == 0 ? events::ContactState::kBegin : events::ContactState::kHold,
                                 .normal = {0.0, 0.0, 1.0},
                                 .slip_m_s = {0.4, 0.0, 0.0},
                                 .force_n = 5.0,
                                 .sweep_m_s = 0.4,
                                 .patch_radius_m = 1e-4}));
    }
    contacts.reach(0.1);
    heard.push_back(play(voice, 4800));
    for (float& p : heard.back()) p *= static_cast<float>(side);
  }
  double largest = 0.0, peak = 0.0;
  for (std::size_t n = 0; n < heard[0].size(); ++n) {
    largest = std::max(largest, std::abs(static_cast<double>(heard[0][n]) - static_cast<double>(heard[1][n])));
    peak = std::max(peak, std::abs(static_cast<double>(heard[0][n])));
  }
  EXPECT_GT(peak, 0.0);
  hold("over_damping", largest / peak, 1e-4, "under roughness, either side of the change of form");
}

/// The sum of the modes' closed forms.
std::vector<Real> calc_sound(const Modes& modes, std::int64_t first, std::size_t samples) {
  std::vector<Real> sound(samples, 0);
  for (std::size_t n = 0; n < samples; ++n) {
    const Real t = static_cast<Real>(first + static_cast<std::int64_t>(n)) / static_cast<Real>(kRate);
    for (const auto& [lambda, decay] : modes) sound[n] += calc_velocity(lambda, decay, t);
  }
  return sound;
}

/// Rms of the error over rms of the sound: 1e-6 is -120 dB.
double compare_rms(const std::vector<float>& heard, const std::vector<Real>& wanted) {
  Real error = 0, size = 0;
  for (std::size_t n = 0; n < heard.size(); ++n) {
    error += (heard[n] - wanted[n]) * (heard[n] - wanted[n]);
    size += wanted[n] * wanted[n];
  }
  return static_cast<double>(std::sqrt(error / size));
}

/// The same of one mode with the level and the phase that fit best, which are the strike's. `wanted` is one sample longer: it and itself a
/// sample later make any level and phase.
double compare_shape(const std::vector<float>& heard, const std::vector<Real>& wanted) {
  Real aa = 0, ab = 0, bb = 0, ay = 0, by = 0;
  for (std::size_t n = 0; n < heard.size(); ++n) {
    const Real a = wanted[n], b = wanted[n + 1];
    aa += a * a, ab += a * b, bb += b * b, ay += a * heard[n], by += b * heard[n];
  }
  const Real det = aa * bb - ab * ab, now = (ay * bb - by * ab) / det, later = (by * aa - ay * ab) / det;
  std::vector<Real> fitted(heard.size());
  for (std::size_t n = 0; n < heard.size(); ++n) fitted[n] = now * wanted[n] + later * wanted[n + 1];
  return compare_rms(heard, fitted);
}

TEST(time, table_turns) {
  // A table holds 16 samples; turns over one, two and four of them make the eight starts of a block. Multiples of 1500 Hz turn by half
  // circles within a table.
  std::vector<double> freqs{20.0, 440.0, 0.49999 * kRate};
  for (int k = 1; k < 16; ++k) {
    for (const double off : {-0.01, 0.0, 0.01}) freqs.push_back(1500.0 * k + off);
  }
  Modes all, dense;
  for (const double freq : freqs) all.emplace_back(to_lambda(freq), 0.0);
  for (int m = 0; m < 4096; ++m) dense.emplace_back(to_lambda(50.0 + 4.0 * m + 4.5e-4 * m * m), 0.5);
  const std::int64_t minute = 60 * static_cast<std::int64_t>(kRate);
  const std::vector<Real> late = calc_sound(all, 10 * minute, 4800), loud = calc_sound(dense, 48000, 1024);
  for (const Isa isa : base::list_instructions()) {
    const synth::ResonatorOptions options{.silence_pa = 1e-30, .isa = isa};
    const std::string name = synth::get_name(isa);
    for (const double freq : freqs) {
      for (const double decay : {0.0, 1.0, 1e4, 0.9 * 2.0 * kPi * freq}) {
        const Modes modes{{to_lambda(freq), decay}};
        if (decay > 0.95 * 2.0 * kPi * freq) continue;  // no table: damped_modes.hpp
        ResonatorBank voice(Model::make(make_bank(modes), {.rate_hz = kRate}), options);
        strike(voice);
        const std::vector<float> heard = play(voice, 1024);
        const std::vector<Real> wanted = calc_sound(modes, 0, heard.size() + 1);
        const std::string part = name + ", " + to_json(freq) + " Hz, decay " + to_json(decay);
        hold("table_turns", compare_shape(heard, wanted), 1e-6, part);
        EXPECT_LT(compare_rms(heard, wanted), 2e-6) << part;
      }
    }
    ResonatorBank voice(Model::make(make_bank(all), {.rate_hz = kRate}), options);
    strike(voice);
    for (int m = 0; m < 10; ++m) play(voice, static_cast<std::size_t>(minute));
    hold("table_turns", compare_rms(play(voice, late.size()), late), 1e-6, name + ", together, after ten minutes");
    ResonatorBank body(Model::make(make_bank(dense), {.rate_hz = kRate}), options);
    strike(body);
    play(body, 48000);
    hold("table_turns", compare_rms(play(body, loud.size()), loud), 1e-6, name + ", 4096 modes");
  }
}

TEST(time, ten_hours) {
  // Without damping, sample by sample: the error at the end holds that of phase and that of level.
  const std::vector<double> freqs{20.0, 55.0, 440.0, 1000.0, 1500.01, 6000.0, 12345.6, 20000.0, 0.499 * kRate};
  Modes modes;
  for (const double freq : freqs) modes.emplace_back(to_lambda(freq), 0.0);
  ResonatorBank voice(Model::make(make_bank(modes), {.rate_hz = kRate}), {.silence_pa = 1e-30});
  strike(voice);
  const std::int64_t samples = 10 * 3600 * static_cast<std::int64_t>(kRate);
  std::vector<float> block(1 << 16);
  play(voice, 128);
  const double energy = voice.calc_energy_j();
  double max = energy;
  while (voice.get_position() + static_cast<std::int64_t>(block.size()) < samples) {
    voice.process(block);
    if (voice.get_position() % synth::kBlock == 0) max = std::max(max, voice.calc_energy_j());
  }
  const std::int64_t first = voice.get_position();
  hold("ten_hours", calc_error(play(voice, static_cast<std::size_t>(samples - first)), first, kRate, modes), 1e-6, "wave at the end");
  hold("ten_hours", max / energy - 1.0, 1e-8, "energy gained");
  hold("ten_hours", 1.0 - voice.calc_energy_j() / energy, 1e-8, "energy lost");
}

TEST(time, denormals) {
  // Down to the smallest float and beyond: right as long as a float can say it, and then nothing.
  const Modes modes{{to_lambda(440.0), 60.0}, {to_lambda(3000.0), 61.0}};
  ResonatorBank voice(Model::make(make_bank(modes), {.rate_hz = kRate}), {.silence_pa = 1e-307});
  strike(voice);
  std::int64_t denormal = 0, last = 0;
  for (std::int64_t start = 0; start < 20 * 48000; start += 4800) {
    const std::vector<float> heard = play(voice, 4800);
    const double size = std::exp(-60.0 * static_cast<double>(start + 4800) / kRate);
    if (size > 1e-34) hold("denormals", calc_error(heard, start, kRate, modes), 1e-6, "against the envelope");
    for (std::size_t n = 0; n < heard.size(); ++n) {
      denormal += std::fpclassify(heard[n]) == FP_SUBNORMAL;
      if (heard[n] != 0.0F) last = start + static_cast<std::int64_t>(n);
    }
  }
  hold("denormals", static_cast<double>(denormal), 0.0, "subnormal samples");
  hold("denormals", static_cast<double>(last) / kRate, 1.0 + std::log(1e38) / 60.0, "seconds until the last sample that is not 0");
  hold("denormals", voice.get_active_mode_count(), 0.0, "modes that are still worked out");
  const std::int64_t spent = voice.get_counters().mode_samples;
  play(voice, 48000);
  hold("denormals", static_cast<double>(voice.get_counters().mode_samples - spent), 0.0, "mode-samples of the silence");
}

TEST(time, impulse_sizes) {
  const Modes modes{{to_lambda(440.0), 6.0}, {to_lambda(3000.0), 31.0}, {to_lambda(900.0), 2.0 * kPi * 900.0}, {to_lambda(200.0), 1e5}};
  const auto model = Model::make(make_bank(modes), {.rate_hz = kRate});
  ResonatorBank unit(model, {.silence_pa = 1e-30});
  strike(unit);
  const std::vector<float> wanted = play(unit, 9600);
  float peak = 0.0F;
  for (const float p : wanted) peak = std::max(peak, std::abs(p));
  for (const double size : {1e-30, 1e-12, 1e12, 1e30}) {
    ResonatorBank voice(model, {.silence_pa = 1e-45});
    strike(voice, size);
    const std::vector<float> heard = play(voice, wanted.size());
    double largest = 0.0;
    for (std::size_t n = 0; n < wanted.size(); ++n)
      largest = std::max(largest, std::abs(static_cast<double>(heard[n]) / size - wanted[n]) / peak);
    hold("impulse_sizes", largest, 1e-6, to_json(size) + " N s against 1 N s");
    hold("impulse_sizes", static_cast<double>(voice.get_counters().resets), 0.0, "resets by " + to_json(size) + " N s");
  }
  // Too much for a float: counted and silent; and the next strike sounds as if nothing had been.
  ResonatorBank burst(model, {.silence_pa = 1e-30});
  strike(burst, 1e38);
  strike(burst, 1e300);
  for (const float p : play(burst, 128)) EXPECT_TRUE(std::isfinite(p));
  hold("impulse_sizes", std::abs(static_cast<double>(burst.get_counters().resets) - 1.0), 0.0, "resets by 1e300 N s, off from 1");
  ASSERT_TRUE(burst.strike({.time_s = 128 / kRate, .impulse_n_s = {0.0, 0.0, 1.0}}));
  hold("impulse_sizes", play(burst, wanted.size()) == wanted ? 0.0 : 1.0, 0.0, "other bits after a reset");
}

}  // namespace
}  // namespace carillon::hard

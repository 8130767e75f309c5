// Hard cases of a scene that plays: more hits than there is room for, blocks of any size, another sample rate, contacts of one step.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/hard/closed_form.hpp"
#include "tests/hard/figure.hpp"

namespace carillon::hard {
namespace {

using events::ContactState;
using std::numbers::pi;
using synth::Effect;
using synth::Model;
using synth::ResonatorBank;
using synth::Synthesiser;
constexpr double kSceneRate = 48000.0;
constexpr int kMillion = 1000000;

/// With the room that a scene has.
void play_million_hits_with_little_room() {
  // Omitted hits are counted, work in a period stays within the limit of that room, nothing else changes.
  std::vector<std::pair<double, double>> modes;
  for (int m = 0; m < 64; ++m) modes.emplace_back(to_lambda(150.0 * (m + 1)), 5.0 + m);
  const auto model = Model::make(make_bank(modes), {.rate_hz = kSceneRate});
  Synthesiser synthesiser({.rate_hz = kSceneRate, .max_strikes = 64, .ring_events = 2000});
  const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
  std::vector<float> left(128), right(128);
  float* const out[2] = {left.data(), right.data()};
  std::int64_t hits = 0, worst = 0, before = 0;
  double peak = 0.0;
  for (int block = 0; block < 375; ++block) {
    for (; hits < kMillion && 1e-6 * static_cast<double>(hits) < (block + 1) * 128 / kSceneRate; ++hits) {
      synthesiser.push(
          events::Impulse{.time_s = 1e-6 * static_cast<double>(hits), .body = body, .impulse_n_s = {0.0, 0.0, 1e-3}, .duration_s = 1e-4});
    }
    synthesiser.process(out, 2, 128);
    const std::int64_t spent = synthesiser.get_counters().mode_samples;
    worst = std::max(worst, spent - before);
    before = spent;
    for (const float p : left) peak = std::max(peak, std::abs(static_cast<double>(p)));
  }
  const synth::SynthesiserCounters c = synthesiser.get_counters();
  hold("million_hits", std::abs(static_cast<double>(c.strikes + c.refused + c.overflows - hits)), 0.0, "hits neither played nor counted");
  hold("million_hits", static_cast<double>(worst) / (64.0 * 128.0), 65.0,
       "work of the worst period over that of ringing: one, and one a strike");
  hold("million_hits", static_cast<double>(c.resets + c.zeroed + c.faults), 0.0, "resets");
  EXPECT_GT(c.strikes, 375 * 32);
  EXPECT_TRUE(std::isfinite(peak) && peak > 0.0);
}

TEST(time, million_hits) {
  // With room for them all: a hit a microsecond is a geometric series, which has a closed form at every sample.
  const double freq = 700.0, decay = 12.0;
  ResonatorBank voice(Model::make(make_bank({{to_lambda(freq), decay}}), {.rate_hz = kSceneRate}),
                      {.max_strikes = 4096, .silence_pa = 1e-30});
  std::vector<float> heard;
  int hits = 0;
  for (int block = 0; block < 375; ++block) {
    for (; hits < kMillion && 1e-6 * hits < (block + 1) * 128 / kSceneRate; ++hits)
      voice.strike({.time_s = 1e-6 * hits, .impulse_n_s = {0.0, 0.0, 1e-3}});
    const std::vector<float> part = play(voice, 128);
    heard.insert(heard.end(), part.begin(), part.end());
  }
  using Complex = std::complex<Real>;
  const Real d = decay, w = std::sqrt(static_cast<Real>(to_lambda(freq)) - d * d), step = 1e-6L;
  const Complex root(-d, w), out(1, d / w);  // q' = Re(out e^{root t})
  Real largest = 0, peak = 0;
  for (std::size_t n = 0; n < heard.size(); ++n) {
    const Real t = static_cast<Real>(n) / 48000;
    const Real count = std::floor(t / step + 1e-6L) + 1;  // hits at or before the sample
    const Complex sum = out * std::exp(root * (t - (count - 1) * step)) * (Complex(1) - std::exp(root * step * count)) /
                        (Complex(1) - std::exp(root * step));
    largest = std::max(largest, std::abs(static_cast<Real>(heard[n]) - 1e-3L * sum.real()));
    peak = std::max(peak, std::abs(1e-3L * sum.real()));
  }
  hold("million_hits", static_cast<double>(largest / peak), 1e-5, "wave against the geometric series");
  const synth::ResonatorCounters& counters = voice.get_counters();
  hold("million_hits", std::abs(static_cast<double>(counters.accepted - kMillion)), 0.0, "hits not played with room for them");
  play_million_hits_with_little_room();
}

/// Three bodies that are struck, slide and fly past.
std::vector<events::Event> make_scene() {
  std::vector<events::Event> events;
  for (int k = 0; k < 60; ++k) {
    const double t = 7.3e-3 * k + 1.3e-4;
    events.emplace_back(
        events::BodyMotion{.time_s = t, .body = 0, .position_m = {3.0 - 10.0 * t, 1.0, 0.2}, .velocity_m_s = {-10.0, 0.0, 0.0}});
    events.emplace_back(
        events::Impulse{.time_s = t, .body = k % 3, .triangle = k % 12, .impulse_n_s = {1e-3, 0.0, 2e-3}, .duration_s = 1e-5 * (k % 40)});
    events.emplace_back(events::LastingContact{.time_s = t,
                                               .id = 9,
                                               .body = 1,
                                               .triangle = 4,
                                               .state = k == 0 ? ContactState::kBegin : ContactState::kHold,
                                               .normal = {0.0, 0.0, 1.0},
                                               .slip_m_s = {0.3, 0.0, 0.0},
                                               .force_n = 2.0,
                                               .sweep_m_s = 0.3 + 0.01 * k,
                                               .patch_radius_m = 1e-4,
                                               .impedance_n_s_m = 2.0});
  }
  return events;
}

std::vector<float> play_scene(int block) {
  const auto model = Model::make(testing::make_cube_bank(testing::make_many_modes(40)), {.rate_hz = kSceneRate});
  Synthesiser synthesiser({.rate_hz = kSceneRate, .max_strikes = 128});
  for (int body = 0; body < 3; ++body) {
    synthesiser.add_body(
        model, {.position_m = {0.5 * body, 1.0, 0.0},
                .effects = synth::kDefaultEffects.with({Effect::kRoughness, Effect::kContactDamping, Effect::kAccelerationNoise})});
  }
  for (const events::Event& event : make_scene()) EXPECT_TRUE(synthesiser.push(event));
  std::vector<float> left(24576), right(24576);
  for (int n = 0; n < 24576; n += block) {
    float* const out[2] = {left.data() + n, right.data() + n};
    synthesiser.process(out, 2, std::min(block, 24576 - n));
  }
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

TEST(time, block_sizes) {
  const std::vector<float> wanted = play_scene(128);
  EXPECT_GT(*std::max_element(wanted.begin(), wanted.end()), 1e-6F);
  for (const int block : {1, 2, 3, 7, 31, 32, 33, 64, 127, 129, 480, 511, 512, 1000, 4096, 8191, 8192}) {
    const std::vector<float> heard = play_scene(block);
    int other = 0;
    for (std::size_t n = 0; n < wanted.size(); ++n) other += heard[n] != wanted[n];
    hold("block_sizes", other, 0.0, "samples with other bits in blocks of " + std::to_string(block));
  }
}

TEST(time, sample_rate_change) {
  // One strike at six rates: each gives the closed form at its own samples, and a mode beyond half of it not at all.
  const Modes modes{{to_lambda(310.0), 8.0}, {to_lambda(3100.0), 40.0}};
  for (const double rate : {8000.0, 22050.0, 44100.0, 48000.0, 96000.0, 192000.0}) {
    ResonatorBank voice(Model::make(make_bank(modes), {.rate_hz = rate}), {.silence_pa = 1e-30});
    const double begin = 0.0123, length = 300e-6;
    ASSERT_TRUE(voice.strike({.time_s = begin + 0.5 * length, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = length}));
    const std::vector<float> heard = play(voice, static_cast<std::size_t>(0.06 * rate));
    Real largest = 0;
    for (int k = 0; k < 60; ++k) {
      const std::size_t n = (0.0122 + (k < 30 ? 2e-5 * k : 1.5e-3 * (k - 29))) * rate;
      Real wanted = 0;
      for (const auto& [lambda, decay] : modes)
        wanted += calc_pushed(lambda, decay, static_cast<Real>(n) / static_cast<Real>(rate) - 0.0123L, length);
      largest = std::max(largest, std::abs(static_cast<Real>(heard[n]) - wanted));
    }
    hold("sample_rate_change", static_cast<double>(largest / 2), 5e-6, to_json(rate) + " Hz against the closed form");
    ResonatorBank above(Model::make(make_bank({{to_lambda(0.52 * rate), 8.0}, {to_lambda(3.1 * rate), 8.0}}), {.rate_hz = rate}),
                        {.silence_pa = 1e-30});
    strike(above);
    float loudest = 0.0F;
    for (const float p : play(above, 4800)) loudest = std::max(loudest, std::abs(p));
    hold("sample_rate_change", static_cast<double>(loudest), 0.0, to_json(rate) + " Hz, modes beyond half of it [Pa]");
  }
  // While it plays: a model of another rate is refused, and the sound continues with the same bits.
  std::vector<std::vector<float>> heard;
  for (const bool asks : {false, true}) {
    Synthesiser synthesiser({.rate_hz = kSceneRate});
    const int body = synthesiser.add_body(Model::make(make_bank(modes), {.rate_hz = kSceneRate}));
    synthesiser.push(events::Impulse{.time_s = 0.001, .body = body, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = 1e-4});
    std::vector<float> left(9600), right(9600);
    for (int n = 0; n < 9600; n += 480) {
      if (asks && n == 4800) {
        const auto other = Model::make(make_bank(modes), {.rate_hz = 44100.0});
        try {
          synthesiser.swap_model(body, other);
          ADD_FAILURE() << "a model of another rate was taken";
        } catch (const InputError& error) {
          hold_refusal("sample_rate_change", error.what(), {"model", "44100", "48000", "Hz"}, "a model of another rate");
        }
      }
      float* const out[2] = {left.data() + n, right.data() + n};
      synthesiser.process(out, 2, 480);
    }
    heard.push_back(left);
  }
  hold("sample_rate_change", heard[0] == heard[1] ? 0.0 : 1.0, 0.0, "other bits after a refusal");
}

TEST(time, one_step_contact) {
  const double rate_of_loss = 20.0, step_s = 2e-3;  // Z phi^2 / 2 [1/s]; the longest step of physics
  const double freq = 9000.0;
  const auto model = Model::make(make_bank({{to_lambda(freq), 0.0}}), {.rate_hz = kSceneRate});
  const auto make = [&](double t, ContactState state) {
    return events::LastingContact{.time_s = t,
                                  .id = 3,
                                  .state = state,
                                  .normal = {0.0, 0.0, 1.0},
                                  .slip_m_s = {0.5, 0.0, 0.0},
                                  .force_n = 3.0,
                                  .sweep_m_s = 0.5,
                                  .patch_radius_m = 1e-4,
                                  .impedance_n_s_m = 2.0 * rate_of_loss};
  };
  // It damps: within the step it comes and goes as a triangle of step / 5 ms, so that exp(-loss step^2 / 5 ms) of the wave stays.
  ResonatorBank voice(model, {.silence_pa = 1e-30});
  synth::ContactForces brake(model, {.effects = {Effect::kContactDamping}});
  voice.attach(&brake);
  strike(voice);
  const double begin = 4800 / kSceneRate;
  const synth::ContactSurface other{};  // of no stiffness: no spring of the contact next to the impedance
  ASSERT_TRUE(brake.take(make(begin, ContactState::kBegin), other) && brake.take(make(begin + step_s, ContactState::kEnd), other));
  brake.reach(1.0);
  play(voice, 128 * 25);
  const double before = voice.calc_energy_j();
  play(voice, 128 * 50);
  const double lost = -0.5 * std::log(voice.calc_energy_j() / before), wanted = rate_of_loss * step_s * step_s / 5e-3;
  hold("one_step_contact", std::abs(lost / wanted - 1.0), 2e-3, "damping against the closed form");
  // It makes noise, and nothing stays of any of its forms: one step, no time at all, a begin without an end, an end without a begin.
  const std::vector<std::vector<events::LastingContact>> forms{{make(0.01, ContactState::kBegin), make(0.01 + step_s, ContactState::kEnd)},
                                                               {make(0.01, ContactState::kBegin), make(0.01, ContactState::kEnd)},
                                                               {make(0.01, ContactState::kBegin)},
                                                               {make(0.01, ContactState::kEnd)},
                                                               {make(0.01, ContactState::kEnd), make(0.01, ContactState::kBegin)}};
  for (const auto& records : forms) {
    ResonatorBank touched(model);
    synth::ContactForces contacts(model, {});
    touched.attach(&contacts);
    for (const events::LastingContact& record : records) contacts.take(record);
    contacts.reach(0.02);
    const std::vector<float> heard = play(touched, 4800);
    const auto bad = std::count_if(heard.begin(), heard.end(), [](float p) { return !(std::abs(p) < 1e3F); });
    hold("one_step_contact", static_cast<double>(bad), 0.0, "samples that are no sound");
    hold("one_step_contact", contacts.is_idle() ? 0.0 : 1.0, 0.0, "contacts left over");
    const std::int64_t samples = contacts.get_counters().samples;
    play(touched, 4800);
    hold("one_step_contact", static_cast<double>(contacts.get_counters().samples - samples), 0.0, "samples of force afterwards");
  }
}

TEST(time, sliding) {
  // Modes from 400 Hz to 9 kHz; the level of 2 s, and whatever is no sound.
  std::vector<std::pair<double, double>> modes;
  for (int m = 0; m < 10; ++m) modes.emplace_back(to_lambda(400.0 * std::pow(2.0, 0.5 * m)), 60.0);
  const auto model = Model::make(make_bank(modes), {.rate_hz = kSceneRate});
  const auto calc_level = [&](double floor_m, double speed_m_s, double load_n) {
    ResonatorBank voice(model, {.silence_pa = 1e-30});
    synth::ContactForces contacts(model, {.surface = {.roughness_m = 0.0, .modulus_pa = 70e9}});
    voice.attach(&contacts);
    const synth::ContactSurface floor{.roughness_m = floor_m, .friction = 0.5, .modulus_pa = 70e9};
    for (const double t : {0.0, 2.2}) {
      contacts.take({.time_s = t,
                     .id = 5,
                     .normal = {0.0, 0.0, 1.0},
                     .slip_m_s = {speed_m_s, 0.0, 0.0},
                     .force_n = load_n,
                     .other_sweep_m_s = speed_m_s,
                     .patch_radius_m = 1e-4},
                    floor);
    }
    contacts.reach(3.0);
    play(voice, 9600);
    double sum = 0.0;
    std::int64_t bad = 0;
    for (const float p : play(voice, 96000)) {
      bad += !std::isfinite(p);
      sum += static_cast<double>(p) * static_cast<double>(p);
    }
    hold("sliding", static_cast<double>(bad), 0.0, "samples that are no number");
    return 10.0 * std::log10(std::max(sum, 1e-300));
  };
  const auto hold_exponent = [&](double from_db, double to_db, double ratio, double low, double high, const std::string& what) {
    const double exponent = (to_db - from_db) / (20.0 * std::log10(ratio));
    hold("sliding", std::abs(exponent - 0.5 * (low + high)), 0.5 * (high - low), what);
  };
  for (const double load : {1e-3, 5.0}) {
    for (const double speed : {0.02, 1.0})
      hold_exponent(calc_level(0.02e-6, speed, load), calc_level(50e-6, speed, load), 2500.0, 0.8, 1.16, "exponent of roughness from 0.98");
    for (const double floor : {0.02e-6, 50e-6})
      hold_exponent(calc_level(floor, 0.02, load), calc_level(floor, 1.0, load), 50.0, 0.7, 0.96, "exponent of speed from 0.83");
    double last = -1e9;
    for (const double floor : {1e-9, 1e-8, 1e-6, 1e-4, 5e-4, 1e-3}) {
      const double level = calc_level(floor, 0.3, load);
      hold("sliding", level > last ? 0.0 : 1.0, 0.0, "rougher and not louder");
      last = level;
    }
  }
  for (const double floor : {1e-30, 1.0, 1e300}) {
    for (const double speed : {1e-3, 10.0, 1e9}) {
      for (const double load : {1e-12, 1e9}) calc_level(floor, speed, load);
    }
  }
}

}  // namespace
}  // namespace carillon::hard

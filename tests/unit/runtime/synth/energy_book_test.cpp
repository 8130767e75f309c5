// Energy balance of the modes against the work of strikes in closed form, and against losses and radiation derived from the sound.
#include "runtime/synth/energy_book.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/bank/air.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "runtime/synth/texture.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

using testing::make_cube_bank;
constexpr double kRate = 48000.0, kPi = std::numbers::pi;

TEST(EnergyBook, ABlowOnABodyAtRestGivesHalfOfItsSquaredShare) {
  const bank::Bank bank = make_cube_bank({{300.0, 5.0}, {1200.0, 900.0}, {2500.0, 40.0}, {800.0, 6000.0}});
  ResonatorBank voice(Model::make(bank), {.audits_energy = true});
  // At the start of a sub-block: all of its decay is in the book's law.
  ASSERT_TRUE(voice.strike({.time_s = 320.0 / kRate, .impulse_n_s = {0.0, 0.0, 0.02}}));
  std::vector<float> sound(kBlock);
  for (int b = 0; b < 4; ++b) voice.process(sound);
  const ModeEnergy energy = voice.get_counters().energy;
  double expected = 0.0;
  for (std::size_t m = 0; m < 4; ++m) expected += 0.5 * std::pow(bank.shape_at(0, m)[2] * 0.02, 2);
  // The book is coarse for modes that decay within a sub-block, half of the energy here.
  EXPECT_NEAR(energy.given_j, expected, 0.35 * expected);
  EXPECT_NEAR(energy.given_j, energy.held_j + energy.lost_j, 1e-12 * expected);
  const bank::Bank slow = make_cube_bank({{300.0, 5.0}, {2500.0, 40.0}});
  ResonatorBank rings(Model::make(slow), {.audits_energy = true});
  ASSERT_TRUE(rings.strike({.time_s = 320.0 / kRate, .impulse_n_s = {0.0, 0.0, 0.02}}));
  for (int b = 0; b < 4; ++b) rings.process(sound);
  EXPECT_NEAR(rings.get_counters().energy.given_j, 2.0 * 0.5 * 0.02 * 0.02, 0.03 * 0.02 * 0.02);
}

/// Events of a body: pulses, forces, sliding and rolling contacts at random times.
std::vector<events::Event> make_events(std::mt19937_64& random, int kinds, double end_s) {
  const auto pick = [&](double low, double high) { return std::uniform_real_distribution(low, high)(random); };
  std::vector<events::Event> events;
  if ((kinds & 1) != 0)
    for (int i = 0; i < 5; ++i)
      events.emplace_back(events::Impulse{
          .time_s = pick(0.01, end_s), .impulse_n_s = {pick(-1, 1), pick(-1, 1), pick(-1, 1)}, .duration_s = pick(0.0, 2e-3)});
  if ((kinds & 2) != 0) {
    std::vector<Vec3> impulses;
    for (int k = 0; k < 60; ++k) impulses.push_back({pick(-0.05, 0.05), 0.0, pick(-0.05, 0.05)});
    events::split_force({.time_s = pick(0.01, end_s), .step_s = pick(5e-5, 3e-4)}, impulses,
                        [&](const events::Force& piece) { events.emplace_back(piece); });
  }
  if ((kinds & 4) != 0) {
    const double begin_s = pick(0.01, 0.05), load_n = pick(1.0, 20.0), slip = pick(0.1, 1.0);
    for (double t = begin_s; t < end_s; t += 1e-3) {
      events::LastingContact contact{.time_s = t, .id = 7, .normal = {0, 0, 1}, .slip_m_s = {slip, 0, 0}, .force_n = load_n};
      contact.state = t == begin_s        ? events::ContactState::kBegin
                      : t + 1e-3 >= end_s ? events::ContactState::kEnd
                                          : events::ContactState::kHold;
      contact.sweep_m_s = 0.4 * slip;
      contact.other_sweep_m_s = slip;
      contact.spin_rad_s = pick(1.0, 2.0);
      contact.patch_radius_m = 1e-4;
      if (contact.state == events::ContactState::kEnd) contact.force_n = 0.0;
      events.emplace_back(contact);
    }
  }
  return events;
}

TEST(EnergyBook, OfRandomScenesIsThatOfTheSound) {
  Texture::make_tables();
  std::mt19937_64 random(3);
  const auto pick = [&](double low, double high) { return std::uniform_real_distribution(low, high)(random); };
  constexpr double kEnd = 0.35;
  for (int trial = 0; trial < 28; ++trial) {
    // A single mode: its velocity is the pressure over the gain.
    const double freq = std::exp(pick(std::log(80.0), std::log(6000.0))), decay = std::exp(pick(0.0, std::log(400.0)));
    const double gain = pick(0.1, 0.9) * std::sqrt(decay / bank::calc_radiation_decay(1.0));
    const bank::Bank bank = make_cube_bank({{freq, decay, gain, {pick(-1, 1), pick(-1, 1), 1.0}}});
    SynthesiserOptions options{.microphones_m = {Vec3{}}, .max_strikes = 256};
    Synthesiser synthesiser(options);
    const int kinds = trial % 7 + 1;
    EffectSet effects{Effect::kModal, Effect::kHertzPulse, Effect::kRoughness, Effect::kRolling};
    if (trial % 2 == 0) effects = effects.with(Effect::kContactDamping);
    const int body = synthesiser.add_body(Model::make(bank), {.position_m = {0, 1, 0}, .effects = effects, .audits_energy = true});
    for (const events::Event& event : make_events(random, kinds, kEnd)) ASSERT_TRUE(synthesiser.push(event));
    std::vector<ModeEnergy> books;
    std::vector<double> lost_j, radiated_j;
    const std::size_t blocks = 0.5 * kRate / kBlock;
    std::vector<float> out(kBlock);
    float* channel = out.data();
    double lost = 0.0, radiated = 0.0;
    std::size_t n = 0;
    for (std::size_t b = 0; b < blocks; ++b) {
      synthesiser.process(&channel, 1, kBlock);
      books.push_back(synthesiser.get_mode_energy(body));
      for (const float p : out) {
        const double v = static_cast<double>(p) / gain;
        lost += 2.0 * decay * v * v / kRate;
        radiated += 4.0 * kPi * static_cast<double>(p) * static_cast<double>(p) / (bank::kAirDensityKgM3 * bank::kSoundSpeedMs) / kRate;
        if ((++n - static_cast<std::size_t>(synthesiser.get_latency())) % kBlock == 0 &&
            n > static_cast<std::size_t>(synthesiser.get_latency())) {
          lost_j.push_back(lost);
          radiated_j.push_back(radiated);
        }
      }
    }
    const ModeEnergy& end = books.back();
    ASSERT_GT(end.given_j, 0.0) << trial;
    double scale = end.given_j;  // forces also do negative work
    for (const ModeEnergy& book : books) scale = std::max(scale, book.held_j);
    for (std::size_t b = 0; b < lost_j.size(); ++b) {
      const ModeEnergy& book = books[b];
      EXPECT_NEAR(book.given_j, book.held_j + book.lost_j, 1e-6 * end.given_j) << trial;
      // The book may be a block behind: entries are at forces and at the start of each block.
      const double taken_j = book.given_j - book.held_j, within_j = 0.02 * scale;
      EXPECT_LE(taken_j, lost_j[b] + within_j) << trial << ", block " << b << ", kinds " << kinds;
      EXPECT_LE(book.radiated_j, radiated_j[b] + within_j) << trial << ", block " << b;
      if (b == 0) continue;
      EXPECT_GE(taken_j, lost_j[b - 1] - within_j) << trial << ", block " << b << ", kinds " << kinds;
      EXPECT_GE(book.radiated_j, radiated_j[b - 1] - within_j) << trial << ", block " << b;
    }
    EXPECT_NEAR(end.given_j - end.held_j, lost_j.back(), 0.02 * end.given_j) << trial;
    EXPECT_NEAR(end.radiated_j, radiated_j.back(), 0.02 * end.given_j) << trial;
    EXPECT_LE(end.radiated_j, end.lost_j) << trial;
  }
}

}  // namespace
}  // namespace carillon::synth

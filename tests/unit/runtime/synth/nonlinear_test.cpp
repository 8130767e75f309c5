// ResonatorBank with coupled modes: linear for soft strikes, Duffing's oscillator for strong ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"
#include "tests/unit/runtime/synth/multipole_cube.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
using testing::InventedMode;
using testing::make_cube_bank;
constexpr double kRate = 48000.0;

/// Forty modes, every other of the first twenty coupled; two do not ring, one of them in the energy.
bank::Bank make_bank(double size = 1e6) {
  std::vector<InventedMode> modes;
  for (int m = 0; m < 40; ++m)
    modes.push_back(
        {180.0 + 310.0 * m, m == 18 || m == 21 ? 1e6 : 6.0 + 0.5 * m, 0.3 + 0.1 * (m % 5), {0.2, 0.1 * (m % 3), 1.0}, 0.02 * m});
  bank::Bank bank = make_cube_bank(modes);
  std::mt19937 chance(4);
  for (int m = 0; m < 20; m += 2) bank.quartic.modes.push_back(m);
  for (std::size_t i = 0; i < 3 * bank::count_pairs(bank.quartic.modes.size()); ++i)
    bank.quartic.rows.push_back(static_cast<float>(size * std::uniform_real_distribution<double>(-1.0, 1.0)(chance)));
  return bank;
}

std::shared_ptr<const Model> make_model(const bank::Bank& bank) { return Model::make(bank, {.rate_hz = kRate}); }

std::vector<float> play(ResonatorBank& voice, std::size_t samples, std::size_t block = 256) {
  std::vector<float> pressure(samples, 0.0F);
  for (std::size_t n = 0; n < samples; n += block) voice.process(std::span(pressure).subspan(n, std::min(block, samples - n)));
  return pressure;
}

/// Level of the difference relative to the sound [dB].
double calc_difference_db(const std::vector<float>& a, const std::vector<float>& b) {
  double difference = 0.0, sound = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n) {
    difference += std::pow(static_cast<double>(a[n]) - static_cast<double>(b[n]), 2);
    sound += static_cast<double>(b[n]) * static_cast<double>(b[n]);
  }
  return 10.0 * std::log10(difference / sound);
}

void strike_softly(ResonatorBank& voice, double impulse_n_s) {
  std::mt19937 chance(9);
  std::uniform_real_distribution<double> number(0.0, 1.0);
  for (int i = 0; i < 12; ++i)
    voice.strike({.time_s = 0.4 * number(chance),
                  .triangle = static_cast<std::int32_t>(12 * number(chance)),
                  .shape = i % 2 == 0 ? PulseShape::kHertz : PulseShape::kGaussian,
                  .barycentric = {0.2, 0.3, 0.5},
                  .impulse_n_s = {impulse_n_s * number(chance), 0.0, impulse_n_s},
                  .duration_s = i % 3 == 0 ? 0.0 : 1e-3 * number(chance)});
  events::Force force{.time_s = 0.1003, .step_s = 3.1e-5, .triangle = 3, .count = 9, .barycentric = {0.1, 0.4, 0.5}};
  for (int i = 0; i < force.count; ++i)
    force.impulse_n_s[i] = {static_cast<float>(0.1 * impulse_n_s * i), 0.0F, static_cast<float>(impulse_n_s)};
  EXPECT_TRUE(voice.push(force));
}

TEST(NonlinearResonators, SoftlyIsTheLinearOneToMinus100Db) {
  const auto model = make_model(make_bank());
  ResonatorBank linear(model), nonlinear(model, {.is_nonlinear = true});
  for (ResonatorBank* voice : {&linear, &nonlinear}) strike_softly(*voice, 1e-6);
  EXPECT_EQ(nonlinear.get_coupled_count(), 9);  // the tenth does not ring
  EXPECT_EQ(linear.get_coupled_count(), 0);
  const std::vector<float> wanted = play(linear, 48000), found = play(nonlinear, 48000);
  EXPECT_LE(calc_difference_db(found, wanted), -100.0);
  // The one is that of the sample before the horizon, half a sample later.
  EXPECT_NEAR(nonlinear.calc_energy_j() / linear.calc_energy_j(), 1.0, 1e-3);
  std::vector<float> a(40), b(40);
  linear.measure_amplitudes(a);
  nonlinear.measure_amplitudes(b);
  for (std::size_t m = 0; m < 40; ++m) EXPECT_NEAR(b[m], a[m], 1e-4F * a[m]) << m;
  // And the same bits however the samples are divided.
  ResonatorBank other(model, {.is_nonlinear = true});
  strike_softly(other, 1e-6);
  EXPECT_EQ(play(other, 48000, 37), found);
}

TEST(NonlinearResonators, SoftlyIsTheLinearOneUnderContactsThatLast) {
  const auto model = make_model(make_bank());
  std::vector<std::vector<float>> heard;
  for (const bool is_nonlinear : {false, true}) {
    ResonatorBank voice(model, {.is_nonlinear = is_nonlinear});
    ContactForces contacts(model, {.effects = kContactEffects});
    voice.attach(&contacts);
    voice.strike({.time_s = 1e-3, .impulse_n_s = {0.0, 0.0, 1e-6}});
    const ContactSurface other{.roughness_m = 2e-9, .friction = 0.5, .modulus_pa = 70e9};
    for (int i = 0; i <= 100; ++i) {
      events::LastingContact c;
      c.time_s = 0.01 + 2e-3 * i;
      c.id = 7;
      c.barycentric = {0.2, 0.3, 0.5};
      c.normal = {0.0, 0.0, 1.0};
      c.slip_m_s = {0.3, 0.0, 0.0};
      c.force_n = 1e-3;
      c.other_sweep_m_s = 0.3;
      c.patch_radius_m = 20e-6;
      c.state = i == 0 ? events::ContactState::kBegin : i == 100 ? events::ContactState::kEnd : events::ContactState::kHold;
      contacts.take(c, other);
    }
    contacts.reach(1.0);
    heard.push_back(play(voice, 24000));
  }
  EXPECT_LE(calc_difference_db(heard[1], heard[0]), -100.0);
}

TEST(NonlinearResonators, SoftlySendsToTheEarsWhatTheLinearOneSends) {
  bank::Bank bank = make_bank();
  std::vector<testing::ModeMultipoles> air;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) air.push_back(testing::make_dipole({0.5, 0.2 * static_cast<double>(m % 4)}));
  testing::give_multipoles(bank, air, 0.1);
  const auto model = make_model(bank);
  std::vector<std::vector<float>> heard;
  for (const EffectSet more : {EffectSet{}, EffectSet{Effect::kNonlinear}}) {
    Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
    const int body =
        synthesiser.add_body(model, {.position_m = {0.0, 0.3, 1.0}, .effects = kDefaultEffects.with(Effect::kDirectivity).with(more)});
    synthesiser.push(events::Impulse{
        .time_s = 0.01, .body = body, .triangle = 4, .barycentric = {0.2, 0.3, 0.5}, .impulse_n_s = {0.0, 0.0, 1e-6}, .duration_s = 2e-4});
    heard.emplace_back(24000);
    float* at = heard.back().data();
    synthesiser.process(&at, 1, 24000);
  }
  EXPECT_LE(calc_difference_db(heard[1], heard[0]), -100.0);
}

TEST(NonlinearResonators, StronglyIsTheOscillatorOfDuffing) {
  bank::Bank bank = make_cube_bank({{300.0, 0.0, 1.0, {0.0, 0.0, 1.0}}});
  const double lambda = bank.eigenvalue_rad2_s2[0];
  // q' = 1 at q = 0. With alpha = 1 at the turning point, (1 + alpha / 2) lambda q^2 = 1.
  const double amplitude = 1.0 / std::sqrt(1.5 * lambda);
  bank.quartic.modes = {0};
  bank.quartic.rows = {static_cast<float>(std::sqrt(lambda / (2.0 * amplitude * amplitude)))};
  ResonatorBank voice(make_model(bank), {.is_nonlinear = true});
  voice.strike({.time_s = 1e-3, .impulse_n_s = {0.0, 0.0, 1.0}});
  const std::vector<float> sound = play(voice, 48000);
  double first = -1.0, last = -1.0;
  int count = -1;
  for (std::size_t n = 100; n + 1 < sound.size(); ++n) {
    if (!(sound[n] < 0.0F && sound[n + 1] >= 0.0F)) continue;
    last = static_cast<double>(n) + static_cast<double>(sound[n] / (sound[n] - sound[n + 1]));
    if (count++ < 0) first = last;
  }
  // 1.31777606496553: the complete elliptic integral for alpha = 1.
  EXPECT_NEAR(1200.0 * std::log2(count * kRate / (last - first) / (300.0 * 1.31777606496553)), 0.0, 0.3);
  EXPECT_NEAR(voice.calc_energy_j(), 0.5, 0.005);
}

TEST(NonlinearResonators, OffIsABankWithoutTheEnergy) {
  bank::Bank with = make_bank();
  with.rigid.volume_m3 = 0.0;  // without a thickness, neither is watched for bending
  bank::Bank without = with;
  without.quartic = {};
  ResonatorBank a(make_model(with)), b(make_model(without));
  for (ResonatorBank* voice : {&a, &b}) strike_softly(*voice, 1.0);
  EXPECT_EQ(play(a, 24000), play(b, 24000));
  EXPECT_EQ(a.get_counters().coupled_samples, 0);
  EXPECT_THROW(ResonatorBank(make_model(without), {.is_nonlinear = true}), InputError);
}

TEST(NonlinearResonators, SleepsAfterwardsInItsInitialState) {
  const auto model = make_model(make_bank());
  ResonatorBank voice(model, {.is_nonlinear = true}), fresh(model, {.is_nonlinear = true});
  voice.strike({.time_s = 1e-3, .impulse_n_s = {0.0, 0.0, 30.0}});
  (void)play(voice, 48000 * 8);
  ASSERT_TRUE(voice.is_idle());
  const double at = static_cast<double>(voice.get_position()) / kRate;
  voice.strike({.time_s = at + 0.01, .impulse_n_s = {0.0, 0.0, 3.0}});
  fresh.strike({.time_s = 0.01, .impulse_n_s = {0.0, 0.0, 3.0}});
  const std::vector<float> later = play(voice, 4800), first = play(fresh, 4800);
  EXPECT_LE(calc_difference_db(later, first), -130.0);
}

TEST(NonlinearResonators, ALimitLeavesFewerCoupledWithoutAClick) {
  const auto model = make_model(make_bank());
  ResonatorBank voice(model, {.is_nonlinear = true});
  voice.strike({.time_s = 1e-3, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = 1e-3});
  std::vector<float> sound = play(voice, 9600);
  voice.set_max_modes(20);  // of 38 modes that ring
  EXPECT_EQ(voice.get_coupled_count(), 4);
  const std::vector<float> rest = play(voice, 9600);
  sound.insert(sound.end(), rest.begin(), rest.end());
  const auto find_step = [&](std::size_t from, std::size_t to) {
    float step = 0.0F;
    for (std::size_t n = from; n < to; ++n) step = std::max(step, std::abs(sound[n + 1] - 2.0F * sound[n] + sound[n - 1]));
    return step;
  };
  EXPECT_LE(find_step(9500, 9800), 1.3F * find_step(9000, 9500));
  voice.set_max_modes(1000);
  EXPECT_EQ(voice.get_coupled_count(), 9);
}

TEST(NonlinearBody, NeedsABankWithTheEnergy) {
  bank::Bank bank = make_bank();
  bank.quartic = {};
  Synthesiser synthesiser({.rate_hz = kRate});
  EXPECT_THROW(synthesiser.add_body(make_model(bank), {.effects = {Effect::kModal, Effect::kNonlinear}}), InputError);
  // Models read from tables have none.
  const auto model = make_model(make_bank());
  EXPECT_NE(model->get_nonlinear(), nullptr);
  EXPECT_EQ(Model::read_tables(model->write_tables(), model->get_surface())->get_nonlinear(), nullptr);
}

/// Bank with the data for a cascade.
bank::Bank make_cascade_bank() {
  bank::Bank bank = make_bank();
  bank.quartic.thickness_m = 1e-3;
  bank.rigid.mass_kg = 1.0;
  return bank;
}

TEST(NonlinearResonators, ACascadeNeedsModesAboveAndAThickness) {
  EXPECT_FALSE(make_model(make_bank())->has_cascade());
  EXPECT_THROW(ResonatorBank(make_model(make_bank()), {.is_nonlinear = true, .has_cascade = true}), InputError);
  EXPECT_TRUE(make_model(make_cascade_bank())->has_cascade());
}

TEST(NonlinearResonators, SoftlyACascadeIsLinearToMinus100Db) {
  const auto model = make_model(make_cascade_bank());
  ResonatorBank linear(model), cascade(model, {.is_nonlinear = true, .has_cascade = true});
  for (ResonatorBank* voice : {&linear, &cascade}) strike_softly(*voice, 1e-6);
  const std::vector<float> wanted = play(linear, 48000), found = play(cascade, 48000);
  EXPECT_LE(calc_difference_db(found, wanted), -100.0);
  ResonatorBank other(model, {.is_nonlinear = true, .has_cascade = true});
  strike_softly(other, 1e-6);
  EXPECT_EQ(play(other, 48000, 37), found);
  EXPECT_GT(other.get_counters().cascade_samples, 0);
}

TEST(NonlinearResonators, RadiationCountsTheModesOfAllKinds) {
  const auto model = make_model(make_cascade_bank());
  std::vector<double> radiated_j;
  for (const auto& [is_nonlinear, has_cascade] : {std::pair{false, false}, {true, false}, {true, true}}) {
    ResonatorBank voice(model, {.is_nonlinear = is_nonlinear, .has_cascade = has_cascade, .audits_energy = true});
    strike_softly(voice, 1e-6);
    (void)play(voice, 48000);
    radiated_j.push_back(voice.get_counters().energy.radiated_j);
  }
  EXPECT_GT(radiated_j[0], 0.0);
  EXPECT_NEAR(radiated_j[1] / radiated_j[0], 1.0, 1e-3);
  EXPECT_NEAR(radiated_j[2] / radiated_j[0], 1.0, 1e-3);
}

TEST(NonlinearResonators, ADisabledCascadeDoesNoWork) {
  const auto model = make_model(make_cascade_bank()), without = make_model(make_bank());
  std::vector<std::vector<float>> heard;
  for (const auto& of : {model, without}) {
    ResonatorBank voice(of, {.is_nonlinear = true});
    voice.strike({.time_s = 1e-3, .impulse_n_s = {0.0, 0.0, 1.0}});
    heard.push_back(play(voice, 9600));
    EXPECT_EQ(voice.get_counters().cascade_samples, 0);
  }
  EXPECT_EQ(heard[0], heard[1]);
}

}  // namespace
}  // namespace carillon::synth

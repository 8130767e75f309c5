// Microphones that turn with the listener, and models that share, mute and measure modes.
#include "runtime/synth/listener.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "runtime/bank/edits.hpp"
#include "runtime/base/error.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
constexpr double kRate = 48000.0;

events::Quaternion turn_about_z(double angle) { return {std::cos(0.5 * angle), 0.0, 0.0, std::sin(0.5 * angle)}; }

TEST(ListenerTracks, microphones_are_on_a_circle_about_a_listener_who_turns) {
  const std::vector<Vec3> ears{{-0.1, 0.0, 0.0}, {0.1, 0.02, 0.0}};
  ListenerTracks listener(64, ears, {1.0, 2.0, 3.0});
  constexpr double kOmega = 3.0, kStep = 1.0 / 60.0;
  for (int k = 0; k <= 30; ++k) {
    const double t = k * kStep;
    ASSERT_TRUE(listener.push(
        {.time_s = t, .position_m = {1.0 + t, 2.0, 3.0}, .velocity_m_s = {1.0, 0.0, 0.0}, .rotation = turn_about_z(kOmega * t)}));
  }
  for (double t = 0.1; t < 0.49; t += 0.0037) {
    for (std::size_t m = 0; m < 2; ++m) {
      const Waypoint here = listener.get_track(m).find(t);
      const double c = std::cos(kOmega * t), s = std::sin(kOmega * t), x = ears[m][0], y = ears[m][1];
      // Between pictures of a screen the way is a cubic with the chords' speeds: 0.1 mm off at most.
      EXPECT_NEAR(here.position_m[0] + x, 1.0 + t + c * x - s * y, 1e-4);
      EXPECT_NEAR(here.position_m[1] + y, 2.0 + s * x + c * y, 1e-4);
      EXPECT_NEAR(here.position_m[2], 3.0, 1e-12);
      EXPECT_NEAR(here.velocity_m_s[0], 1.0 - kOmega * (s * x + c * y), 0.03);
      EXPECT_NEAR(here.velocity_m_s[1], kOmega * (c * x - s * y), 0.03);
    }
    const Waypoint middle = listener.get_middle_track().find(t);
    EXPECT_NEAR(middle.position_m[0], 1.0 + t - 0.01 * std::sin(kOmega * t), 1e-4);
  }
}

TEST(ListenerTracks, without_turns_all_tracks_are_the_listeners) {
  ListenerTracks listener(8, {{-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}}, {});
  ASSERT_TRUE(listener.push({.time_s = 1.0, .position_m = {1.0, 0.0, 0.0}}));
  EXPECT_EQ(&listener.get_track(0), &listener.get_track(1));
  EXPECT_EQ(&listener.get_track(0), &listener.get_middle_track());
  EXPECT_FALSE(listener.push({.time_s = 0.5, .position_m = {1.0, 0.0, 0.0}})) << "earlier";
  EXPECT_FALSE(listener.push({.time_s = 2.0, .position_m = {std::nan(""), 0.0, 0.0}}));
  EXPECT_FALSE(listener.push({.time_s = 2.0, .rotation = {std::nan(""), 0, 0, 0}}));
}

TEST(ListenerTracks, the_first_turn_begins_where_the_listener_was) {
  ListenerTracks listener(8, {{0.1, 0.0, 0.0}}, {});
  ASSERT_TRUE(listener.push({.time_s = 1.0}));
  ASSERT_TRUE(listener.push({.time_s = 1.1, .rotation = turn_about_z(pi)}));
  EXPECT_NEAR(listener.get_track(0).find(1.0).position_m[0], 0.0, 1e-12);
  EXPECT_NEAR(listener.get_track(0).find(1.1).position_m[0], -0.2, 1e-12);
}

TEST(ResonatorBank, amplitudes_are_those_of_the_oscillators) {
  // An ideal impulse J gives q' = phi J; q then swings by phi J / omega_d, and dies away as exp(-d t).
  const bank::Bank bank = testing::make_cube_bank({{500.0, 20.0, 1.0, {0, 0, 2.0}}, {30000.0, 1.0}, {900.0, 3.0, 0.0, {0, 0, 0.5}}});
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
  const int body = synthesiser.add_body(Model::make(bank, {.rate_hz = kRate}), {.position_m = {0, 1, 0}});
  ASSERT_TRUE(synthesiser.push(events::Impulse{.body = body, .triangle = 4, .impulse_n_s = {0, 0, 0.03}}));
  std::vector<float> sound(128), amplitudes(3);
  for (int b = 1; b <= 40; ++b) {
    float* out = sound.data();
    synthesiser.process(&out, 1, 128);
    ASSERT_TRUE(synthesiser.measure_amplitudes(body, amplitudes));
    const double t = b * 128.0 / kRate;
    const auto expect = [&](double freq_hz, double decay, double shape) {
      const double omega = 2.0 * pi * freq_hz, omega_d = std::sqrt(omega * omega - decay * decay);
      return shape * 0.03 / omega_d * std::exp(-decay * t);
    };
    EXPECT_NEAR(amplitudes[0] / expect(500.0, 20.0, 2.0), 1.0, 1e-3) << b;
    EXPECT_EQ(amplitudes[1], 0.0F) << "above the Nyquist frequency";
  }
  EXPECT_FALSE(synthesiser.measure_amplitudes(7, amplitudes));
  EXPECT_EQ(amplitudes[0], 0.0F);
}

std::vector<float> ring(std::shared_ptr<const Model> model) {
  ResonatorBank voice(std::move(model));
  EXPECT_TRUE(voice.strike({.time_s = 0.001, .triangle = 4, .impulse_n_s = {0.01, 0.02, 0.03}, .duration_s = 1e-4}));
  std::vector<float> sound(9600, 0.0F);
  voice.process(sound);
  return sound;
}

TEST(Model, all_solos_together_are_the_whole) {
  std::vector<testing::InventedMode> modes;
  for (int k = 0; k < 21; ++k) modes.push_back({300.0 + 170.0 * k, 5.0 + k, 1.0 / (1 + k % 5), {0.2 * (k % 3), 1.0, 0.1 * k}, 0.05 * k});
  modes.push_back({4500.0, 40000.0, 1.0, {0, 0, 1}});  // over-damped
  const auto model = Model::make(testing::make_cube_bank(modes), {.rate_hz = kRate});
  const std::vector<float> whole = ring(model);
  std::vector<double> sum(whole.size());
  for (int m = 0; m < 22; ++m) {
    const auto solo = Model::make_solo(*model, m);
    EXPECT_EQ(solo->get_surface(), model->get_surface());
    const std::vector<float> one = ring(solo);
    for (std::size_t n = 0; n < sum.size(); ++n) sum[n] += static_cast<double>(one[n]);
  }
  double power = 0.0, off = 0.0;
  for (std::size_t n = 0; n < sum.size(); ++n) {
    power += static_cast<double>(whole[n]) * whole[n];
    off += std::pow(sum[n] - whole[n], 2);
  }
  EXPECT_GT(power, 0.0);
  EXPECT_LT(off, 1e-11 * power);
  for (const float p : ring(Model::make_solo(*model, 99))) ASSERT_EQ(p, 0.0F);
}

TEST(Model, a_model_like_another_shares_its_surface_and_sounds_as_one_of_its_own) {
  std::vector<testing::InventedMode> modes;
  for (int k = 0; k < 40; ++k) modes.push_back({300.0 + 170.0 * k, 5.0 + k, 1.0 / (1 + k % 5), {0.2 * (k % 3), 1.0, 0.1 * k}, 0.05 * k});
  const bank::Bank bank = testing::make_cube_bank(modes);
  const bank::Bank edited = bank::calc_edited(bank, {.size_scale = 1.3, .alphas = {{1e-6, 3.0}}});
  const auto first = Model::make(bank, {.rate_hz = kRate});
  const auto own = Model::make(edited, {.rate_hz = kRate}), like = Model::make(edited, {.rate_hz = kRate, .like = first.get()});
  EXPECT_EQ(like->get_surface(), first->get_surface());
  EXPECT_NE(own->get_surface(), first->get_surface());
  const std::vector<float> a = ring(own), b = ring(like);
  double power = 0.0, off = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n) {
    power += static_cast<double>(a[n]) * a[n];
    off += std::pow(static_cast<double>(a[n]) - b[n], 2);
  }
  EXPECT_LT(off, 1e-11 * power);
  // Models of other bodies, and those with fewer audible modes, have their own surface.
  const auto smaller = bank::calc_edited(bank, {.size_scale = 0.2});
  EXPECT_NE(Model::make(smaller, {.rate_hz = kRate, .like = first.get()})->get_surface(), first->get_surface());
}

TEST(Model, all_that_a_nonlinear_energy_holds_counts_as_memory) {
  bank::Bank bank = testing::make_cube_bank({{300.0, 5.0}, {700.0, 5.0}, {1100.0, 5.0}});
  const std::size_t linear = Model::make(bank, {.rate_hz = kRate})->calc_bytes();
  bank.quartic.modes = {0, 1, 2};
  bank.quartic.rows.assign(1000 * bank::count_pairs(3), 1.0F);
  const std::size_t flat = Model::make(bank, {.rate_hz = kRate})->calc_bytes();
  EXPECT_GE(flat - linear, 1000 * 6 * sizeof(float) + 3 * (sizeof(std::int32_t) + 2 * sizeof(double)));
  bank.quartic.linear.assign(1000 * 3, 1e-9);
  EXPECT_EQ(Model::make(bank, {.rate_hz = kRate})->calc_bytes() - flat, 1000 * 3 * sizeof(double));
}

}  // namespace
}  // namespace carillon::synth

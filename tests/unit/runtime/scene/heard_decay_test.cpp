// Decays of the tables against decays fitted to the sound of single modes.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <vector>

#include "runtime/bank/corrected.hpp"
#include "runtime/bank/mounting/heard.hpp"
#include "runtime/bank/write.hpp"
#include "runtime/scene/banks.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::scene {
namespace {

constexpr double kHeardRateHz = 48000.0;

/// Decay of one mode of a body [1/s], from its energy in two windows.
double fit_decay(const bank::Bank& played, int mode, double about_per_s) {
  synth::ResonatorBank voice(synth::Model::make_solo(*synth::Model::make(played, {.rate_hz = kHeardRateHz}), mode));
  voice.strike({.time_s = 0.001, .triangle = 3, .barycentric = {0.3, 0.3, 0.4}, .impulse_n_s = {1.0, 2.0, 3.0}});
  const double apart_s = std::min(2.0, 1.5 / about_per_s), window_s = std::max(0.02, 0.2 * apart_s);
  std::vector<float> sound(static_cast<std::size_t>((0.002 + apart_s + window_s) * kHeardRateHz) + 128, 0.0F);
  voice.process(sound);
  const auto sum = [&](double from_s) {
    double squares = 0.0;
    for (auto n = static_cast<std::size_t>(from_s * kHeardRateHz); n < static_cast<std::size_t>((from_s + window_s) * kHeardRateHz); ++n)
      squares += static_cast<double>(sound[n]) * static_cast<double>(sound[n]);
    return squares;
  };
  return std::log(sum(0.002) / sum(0.002 + apart_s)) / (2.0 * apart_s);
}

void compare(const char* what, const bank::Bank& bank, double least_share) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / ("carillon-heard-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  bank::write_bank(bank, folder / "body.hdf");
  Scene scene = parse_scene(
      base::parse_document(R"({"duration_s": 1, "bodies": [{"name": "a", "bank": "body.hdf", "fixed": true}]})", folder / "scene.json"));
  const Banks banks = read_banks(scene);
  const bank::Bank stored = bank::read_bank(folder / "body.hdf");
  const std::vector<bank::HeardMode> heard = mounting::calc_heard(stored);
  const std::vector<std::size_t> order = bank::sort_played_modes(stored);
  const bank::Bank& played = *scene.bodies[0].spec.bank;
  ASSERT_EQ(heard.size(), played.mode_count()) << what;
  int compared = 0;
  double most = 0.0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const bank::HeardMode& mode = heard[order[k]];
    EXPECT_NEAR(mode.freq_hz, played.freq_hz(k), 1e-9 * mode.freq_hz) << what << ", mode " << k;
    const double decay = mode.calc_decay_per_s();
    most = std::max(most, (mode.radiation_per_s + mode.supports_per_s) / decay);
    if (!(decay > 1.0 && decay < 0.05 * 2.0 * 3.14159 * mode.freq_hz && decay < 200.0)) continue;
    EXPECT_NEAR(fit_decay(played, static_cast<int>(k), decay), decay, 0.03 * decay) << what << ", mode " << k;
    EXPECT_NEAR(mode.calc_t60_s() * decay, std::log(1000.0), 1e-9) << what;
    ++compared;
  }
  EXPECT_GT(compared, 0) << what;
  EXPECT_GE(most, least_share) << what;
  std::filesystem::remove_all(folder);
}

TEST(HeardDecay, MatchesTheSoundOfEachMode) {
  compare("of the mesh", bank::example::make_bank(), 0.0);
  compare("corrected", bank::example::make_corrected_bank(), 0.0);
  compare("in air", bank::example::make_radiating_bank(2, 9), 0.2);
  bank::Bank held = bank::example::make_supported_bank();
  const double first_per_s = mounting::calc_heard(held)[0].supports_per_s;  // proportional to the square of the reactions
  ASSERT_GT(first_per_s, 0.0);
  for (double& reaction : held.supports.reaction) reaction *= std::sqrt(20.0 / first_per_s);
  compare("on a wall", held, 0.05);
  bank::Bank table = bank::example::make_bank();
  table.damping = {.law = "loss_table", .coefficient = {}, .power = {}, .freq_hz = {500.0, 20000.0}, .loss_factor = {4e-3, 1e-3}};
  table.material.alpha1_s = table.material.alpha2_per_s = 0.0;
  for (std::size_t m = 0; m < table.mode_count(); ++m)
    table.decay_per_s[m] = bank::calc_decay(table.damping, table.material, table.eigenvalue_rad2_s2[m]);
  compare("by a table of losses", table, 0.0);
}

}  // namespace
}  // namespace carillon::scene

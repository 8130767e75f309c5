#include "runtime/host/render.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "runtime/host/report.hpp"
#include "runtime/host/sound_file.hpp"
#include "tests/synth/cube_bank.hpp"

namespace carillon::host {
namespace {

using std::numbers::pi;

/// One cube at `position`, still, struck once in z with 1 N s at `time_s`; the listener at the origin looks along +y.
struct Case {
  bank::Bank bank;
  Scene scene;
  contact::Simulation simulation;
  Case(const std::vector<testing::InventedMode>& modes, const Vec3& position, double time_s) : bank(testing::make_cube_bank(modes)) {
    scene.file = "case.json";
    scene.duration_s = 0.5;
    scene.bodies.resize(1);
    scene.bodies[0].name = "cube";
    scene.bodies[0].spec.initial.position_m = position;
    scene.listener.position_m = {0.0, 0.0, 0.0};
    contact::Pose at = scene.bodies[0].spec.initial;
    simulation.poses.resize(1);
    simulation.poses[0].push_back(at);
    at.time_s = scene.duration_s;
    simulation.poses[0].push_back(at);
    simulation.impulses.push_back({.time_s = time_s, .body = 0, .triangle = 0, .barycentric = {1, 0, 0}, .impulse_n_s = {0, 0, 1}});
  }
  Sound render(int rate_hz = 48000) const { return calc_sound(scene, {&bank}, simulation, rate_hz); }
};

TEST(Render, PressureAtTheEarsIsTheClosedForm) {
  // An undamped mode of gain 2 Pa at 1 m, struck at 0.1 s, 3 m to the right on the line of the ears.
  const Case c({{1000.0, 0.0, 2.0}}, {3.0, 0.0, 0.0}, 0.1);
  const Sound sound = c.render();
  ASSERT_EQ(sound.pressure_pa[0].size(), 24000u);
  for (int ear = 0; ear < 2; ++ear) {
    const double r = ear == 0 ? 3.1 : 2.9;
    for (int n = 0; n < 24000; ++n) {
      const double t = n / 48000.0 - 0.1 - r / 343.0;
      if (std::abs(t) < 16.0 / 48000.0) continue;  // the band limit of the delay rings about the jump
      const double expected = t < 0.0 ? 0.0 : 2.0 / r * std::cos(2 * pi * 1000.0 * t);
      ASSERT_NEAR(sound.pressure_pa[ear][n], expected, 2e-4 * 2.0 / r) << "ear " << ear << " sample " << n;
    }
  }
  EXPECT_NEAR(sound.body_peak_pa[0], 2.0, 1e-3);
  EXPECT_EQ(sound.modes, 1);
  EXPECT_EQ(sound.strikes, 1);
}

TEST(Render, NoSoundComesBeforeTheContactCanBeHeard) {
  const Case c({{1000.0, 5.0, 2.0}}, {0.0, 3.43, 0.0}, 0.1);
  const Sound sound = c.render();
  const auto arrival = static_cast<std::size_t>((0.1 + std::hypot(3.43, 0.1) / 343.0) * 48000.0);
  for (std::size_t n = 0; n + 16 < arrival; ++n) ASSERT_EQ(sound.pressure_pa[0][n], 0.0) << n;
  EXPECT_GT(std::abs(sound.pressure_pa[0][arrival + 2]), 0.1);
}

TEST(Render, ABodyThatFliesAwayIsHeardLowerAndSofter) {
  Case c({{1000.0, 0.0, 1.0}}, {0.0, 1.0, 0.0}, 0.001);
  c.simulation.poses[0] = {{0.0, {0.0, 1.0, 0.0}}, {0.25, {0.0, 6.0, 0.0}}, {0.5, {0.0, 11.0, 0.0}}};
  const Sound sound = c.render();
  const auto component = [&](double freq, int from) {
    std::complex<double> sum = 0.0;
    for (int i = 0; i < 2400; ++i) {
      sum += (0.5 - 0.5 * std::cos(2 * pi * i / 2400.0)) * sound.pressure_pa[0][from + i] *
             std::polar(1.0, -2 * pi * freq * (from + i) / 48000.0);
    }
    return sum / 600.0;
  };
  const double expected = 1000.0 / (1.0 + 20.0 / 343.0);
  const double advance = std::arg(component(expected, 16800) / component(expected, 14400));
  EXPECT_NEAR(expected + advance / (2 * pi * 0.05), expected, 1e-3 * expected);
  EXPECT_GT(std::abs(component(expected, 4800)), 1.5 * std::abs(component(expected, 19200)));
}

TEST(Render, ABodyThatFallsOutOfHearingDoesNoHarm) {
  Case c({{1000.0, 1.0, 1.0}}, {0.0, 1.0, 0.0}, 0.001);
  c.simulation.poses[0] = {{0.0, {0.0, 1.0, 0.0}}, {0.1, {0.0, 1.0, -10.0}}, {0.5, {0.0, 1.0, -1e7}}};
  const Sound sound = c.render();
  EXPECT_TRUE(std::isfinite(calc_peak_pa(sound)));
  EXPECT_GT(calc_peak_pa(sound), 0.1);
}

TEST(Render, TheRateOfTheOutputDecidesWhichModesSound) {
  const Case c({{1000.0, 5.0}, {15000.0, 5.0}, {23999.0, 5.0}, {30000.0, 5.0}}, {0.0, 1.0, 0.0}, 0.1);
  EXPECT_EQ(c.render(48000).modes, 3);
  EXPECT_EQ(c.render(22050).modes, 1);
  EXPECT_EQ(c.render(96000).modes, 4);
}

TEST(Render, ASceneWithoutContactsIsSilentAndStaysFinite) {
  Case c({{1000.0, 5.0}}, {0.0, 1.0, 0.0}, 0.1);
  c.simulation.impulses.clear();
  const Sound sound = c.render();
  EXPECT_EQ(calc_peak_pa(sound), 0.0);
  const Gain gain = calc_gain(c.scene.output, 0.0);
  EXPECT_TRUE(std::isfinite(gain.per_pa));
  const std::string wav = make_wav(sound, gain.per_pa, SampleFormat::kPcm24);
  ASSERT_EQ(wav.size() % 2, 0u);
  EXPECT_EQ(wav.find_first_not_of('\0', wav.size() - 24000 * 6), std::string::npos);
  Figures figures;
  figures.levels = calc_levels(sound);
  EXPECT_NE(make_report_json(c.scene, c.simulation, sound, figures).find("\"mean_db_spl\": null"), std::string::npos);
}

TEST(Render, ImpulsesThatAreNoNumbersAreLeftOutAndCounted) {
  Case c({{1000.0, 5.0}}, {0.0, 1.0, 0.0}, 0.1);
  contact::Impulse bad = c.simulation.impulses[0];
  bad.impulse_n_s[1] = std::numeric_limits<double>::quiet_NaN();
  c.simulation.impulses.push_back(bad);
  bad = c.simulation.impulses[0];
  bad.body = 7;
  c.simulation.impulses.push_back(bad);
  const Sound sound = c.render();
  EXPECT_EQ(sound.refused, 1);
  EXPECT_EQ(sound.strikes, 1);
  EXPECT_TRUE(std::isfinite(calc_peak_pa(sound)));
}

TEST(Render, GainIsAutomaticGivenOrReducedButNeverClips) {
  Output output;
  EXPECT_NEAR(calc_gain(output, 4.0).per_pa * 4.0, std::pow(10.0, -0.05), 1e-12);
  EXPECT_NEAR(calc_gain(output, 1e-9).per_pa * 1e-9, std::pow(10.0, -0.05), 1e-12);
  output.gain_per_pa = 0.2;
  EXPECT_EQ(calc_gain(output, 4.0).per_pa, 0.2);
  EXPECT_FALSE(calc_gain(output, 4.0).reduced);
  EXPECT_FALSE(calc_gain(output, 5.0).reduced);
  const Gain reduced = calc_gain(output, 6.0);
  EXPECT_TRUE(reduced.reduced);
  EXPECT_NEAR(reduced.per_pa * 6.0, std::pow(10.0, -0.05), 1e-12);
}

TEST(Render, LevelsAreDecibelsRe20MicroPascal) {
  // A tone of 1 Pa rms is 93.98 dB.
  Sound sound;
  sound.rate_hz = 48000;
  for (auto& ear : sound.pressure_pa) {
    for (int n = 0; n < 48000; ++n) ear.push_back(n < 24000 ? std::sqrt(2.0) * std::sin(2 * pi * 1000.0 * n / 48000.0) : 0.0);
  }
  const Levels levels = calc_levels(sound);
  EXPECT_NEAR(levels.loudest_db, 93.979, 0.001);
  EXPECT_NEAR(levels.mean_db, 93.979 - 3.0103, 0.001);
}

TEST(Render, ATrajectoryHoldsFewPosesAndThePlacesOfTheImpulses) {
  Case c({{1000.0, 5.0}}, {0.0, 1.0, 0.0}, 0.25);
  c.simulation.poses[0].clear();
  for (int i = 0; i <= 5000; ++i)
    c.simulation.poses[0].push_back({i * 1e-4, {i * 2e-4, 1.0, 0.0}, {std::sqrt(0.5), 0.0, 0.0, std::sqrt(0.5)}});
  const std::string json = make_trajectory_json(c.scene, {&c.bank}, c.simulation);
  std::size_t rows = 0;
  for (std::size_t at = json.find("\n    ["); at != std::string::npos; at = json.find("\n    [", at + 1)) ++rows;
  EXPECT_LE(rows, 101u);
  EXPECT_GE(rows, 95u);
  EXPECT_NE(json.find("\"height_m\": null"), std::string::npos);
  // Corner 0 is (-0.05, -0.05, -0.05); a quarter turn about z takes it to (0.05, -0.05, -0.05), at t = 0.25 s shifted by (0.5, 1, 0).
  EXPECT_NE(json.find("\"world_m\": [0.55, 0.95, -0.05]"), std::string::npos) << json.substr(json.size() - 300);
  EXPECT_EQ(count_contacts(c.simulation), 1);
}

}  // namespace
}  // namespace carillon::host

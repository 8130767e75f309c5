// Rendering of short scenes; longer than most files.
#include "runtime/render/render.hpp"

#include <gtest/gtest.h>
#include <sndfile.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <numbers>
#include <string>

#include "runtime/acoustics/head/sofa.hpp"
#include "runtime/base/error.hpp"
#include "runtime/render/report.hpp"
#include "runtime/render/sound_file.hpp"
#include "runtime/scene/microphones.hpp"
#include "tests/support/folder.hpp"
#include "tests/support/paths.hpp"
#include "tests/unit/runtime/acoustics/head/oracle.hpp"
#include "tests/unit/runtime/render/heard.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"
#include "tests/unit/runtime/synth/multipole_cube.hpp"

namespace carillon::render {
namespace {

using std::numbers::pi;

/// A store with these channels of equal length.
sound::SoundStore keep(const std::vector<std::vector<double>>& pressure_pa, int rate_hz) {
  sound::SoundStore store(rate_hz, pressure_pa.size());
  for (std::size_t n = 0; n < pressure_pa[0].size(); ++n) {
    std::vector<float> frame;
    for (const auto& channel : pressure_pa) frame.push_back(static_cast<float>(channel[n]));
    store.append(frame);
  }
  return store;
}

std::string make_wav(const sound::SoundStore& store, double gain_per_pa, scene::SampleFormat format) {
  std::string bytes;
  write_wav(store, gain_per_pa, format, [&](std::string_view piece) { bytes += piece; });
  EXPECT_EQ(bytes.size(), calc_wav_bytes(store.get_channels(), format, store.get_frames()));
  return bytes;
}

/// One cube at `position`, at rest, struck once in z with 1 N s at `time_s`; the listener at the origin looks along +y.
struct Case {
  bank::Bank bank;
  scene::Scene scene;
  physics::Simulation simulation;
  Case(const std::vector<testing::InventedMode>& modes, const Vec3& position, double time_s) : bank(testing::make_cube_bank(modes)) {
    scene.file = "case.json";
    scene.duration_s = 0.5;
    scene.bodies.resize(1);
    scene.bodies[0].name = "cube";
    scene.bodies[0].spec.initial.position_m = position;
    scene.listener.position_m = {0.0, 0.0, 0.0};
    physics::Pose at = scene.bodies[0].spec.initial;
    simulation.poses.resize(1);
    simulation.poses[0].push_back(at);
    at.time_s = scene.duration_s;
    simulation.poses[0].push_back(at);
    simulation.impulses.push_back({.time_s = time_s, .body = 0, .triangle = 0, .barycentric = {1, 0, 0}, .impulse_n_s = {0, 0, 1}});
  }
  /// Waypoints and impulses as events.
  std::vector<events::Event> list_events() const {
    std::vector<synth::PathPoint> places;
    for (const physics::Pose& pose : simulation.poses[0]) places.push_back({pose.time_s, pose.position_m});
    const synth::Trajectory track = synth::make_trajectory(places);
    std::vector<events::Event> events;
    for (std::size_t i = 0; i < track.get_count(); ++i) {
      const synth::Waypoint& at = track.get_waypoint(i);
      events.emplace_back(events::BodyMotion{at.time_s, 0, at.position_m, at.velocity_m_s, simulation.poses[0][i].rotation});
    }
    for (const physics::Impulse& impulse : simulation.impulses) events.emplace_back(impulse);
    return events;
  }
  Heard render(int rate_hz = 48000) const { return calc_sound(scene, {&bank}, list_events(), {.rate_hz = rate_hz}); }
};

TEST(Render, PressureAtTheEarsIsTheClosedForm) {
  // An undamped mode of gain 2 Pa at 1 m, struck at 0.1 s, 3 m to the right on the line of the ears.
  const Case c({{1000.0, 0.0, 2.0}}, {3.0, 0.0, 0.0}, 0.1);
  const Heard sound = c.render();
  ASSERT_EQ(sound.pressure_pa[0].size(), 24000u);
  for (int ear = 0; ear < 2; ++ear) {
    const double r = ear == 0 ? 3.1 : 2.9;
    for (int n = 0; n < 24000; ++n) {
      const double t = n / 48000.0 - 0.1 - r / 343.0;
      if (std::abs(t) < 16.0 / 48000.0) continue;  // ringing of the delay's band limit at the jump
      const double expected = t < 0.0 ? 0.0 : 2.0 / r * std::cos(2 * pi * 1000.0 * t);
      ASSERT_NEAR(sound.pressure_pa[ear][n], expected, 2e-4 * 2.0 / r) << "ear " << ear << " sample " << n;
    }
  }
  EXPECT_NEAR(sound.body_peak_pa[0], 2.0, 1e-3);
  EXPECT_EQ(sound.modes, 1);
  EXPECT_EQ(sound.strikes, 1);
}

TEST(Render, EachMicrophoneHasItsPosition) {
  for (const std::size_t count : {1u, 2u, 5u}) {
    Case c({{1000.0, 0.0, 2.0}}, {0.5, 0.0, 0.2}, 0.1);
    for (std::size_t i = 0; i < count; ++i) c.scene.microphones_m.push_back({0.7 * static_cast<double>(i), 1.0, -0.3});
    const Heard sound = c.render();
    ASSERT_EQ(sound.pressure_pa.size(), count);
    for (std::size_t i = 0; i < count; ++i) {
      const double r = std::hypot(0.7 * static_cast<double>(i) - 0.5, 1.0, 0.5);
      for (int n = 6000; n < 24000; ++n) {
        ASSERT_NEAR(sound.pressure_pa[i][n], 2.0 / r * std::cos(2 * pi * 1000.0 * (n / 48000.0 - 0.1 - r / 343.0)), 2e-4 * 2.0 / r)
            << i << " " << n;
      }
    }
    const std::string wav = make_wav(keep(sound.pressure_pa, 48000), 0.1, scene::SampleFormat::kPcm16);
    EXPECT_EQ(wav[22], static_cast<char>(count));
    EXPECT_EQ(wav.size(), (count > 2 ? 68 : 44) + 24000 * 2 * count);
    EXPECT_TRUE(std::isfinite(sound.levels.mean_db));
  }
}

TEST(Render, AllInstructionSetsMatchTheClosedFormToSinglePrecision) {
  for (const synth::Isa isa : base::list_instructions()) {
    Case c({{1000.0, 0.0, 2.0}}, {3.0, 0.0, 0.0}, 0.1);
    c.scene.quality.instructions = isa;
    const Heard sound = c.render();
    for (int n = 6000; n < 24000; ++n)
      ASSERT_NEAR(sound.pressure_pa[0][n], 2.0 / 3.1 * std::cos(2 * pi * 1000.0 * (n / 48000.0 - 0.1 - 3.1 / 343.0)), 2e-4 * 2.0 / 3.1);
  }
}

TEST(Render, BodiesSleepBelowTheSilenceThresholdOfTheScene) {
  // A mode that decays by e^-100 t from 2 / 3 Pa is cut off at 1 Pa; the time is that at 1 m.
  Case c({{1000.0, 100.0, 2.0}}, {3.0, 0.0, 0.0}, 0.1);
  const auto find_last_sample = [](const Heard& sound) {
    std::size_t last = sound.pressure_pa[0].size();
    while (last > 0 && sound.pressure_pa[0][last - 1] == 0.0) --last;
    return last;
  };
  const std::size_t usual = find_last_sample(c.render());
  c.scene.quality.silence_pa = 0.2;
  // Below 0.2 Pa / (1 group + 1) after ln(20) / 100 s, checked every 1024 samples.
  const double until_s = 0.1 + 3.1 / 343.0 + std::log(20.0) / 100.0;
  EXPECT_NEAR(static_cast<double>(find_last_sample(c.render())) / 48000.0, until_s + 0.5 * 1024 / 48000.0, 0.5 * 1024 / 48000.0 + 2e-3);
  EXPECT_GT(static_cast<double>(usual) / 48000.0, until_s + 0.1);
}

TEST(Render, NumberOfRingingModesIsLimited) {
  std::vector<testing::InventedMode> modes;
  for (int i = 0; i < 64; ++i) modes.push_back({400.0 + 150.0 * i, 2.0, 1.0 / (1.0 + i)});
  Case c(modes, {3.0, 0.0, 0.0}, 0.01);
  const RenderOptions options{.rate_hz = 48000};
  const auto count_mode_samples = [&](const Sound& sound) { return sound.effect_counters[0].units[synth::Effect::kModal]; };
  const auto all = count_mode_samples(calc_sound(c.scene, {&c.bank}, c.list_events(), options));
  c.scene.quality.modes = 16;
  const auto few = count_mode_samples(calc_sound(c.scene, {&c.bank}, c.list_events(), options));
  EXPECT_NEAR(static_cast<double>(all) / static_cast<double>(few), 4.0, 0.4);
}

TEST(Render, EarsMoveWithTheListener) {
  Case c({{1000.0, 0.0, 2.0}}, {0.0, 0.0, 0.0}, 0.01);
  c.scene.listener.path = {{0.0, {1.0, -3.0, 0.0}}, {0.6, {1.0, 3.0, 0.0}}};
  c.scene.listener.position_m = {1.0, -3.0, 0.0};
  const Heard sound = c.render();
  for (int ear = 0; ear < 2; ++ear) {
    for (int n = 2000; n < 24000; ++n) {
      const double t = n / 48000.0, r = std::hypot(ear == 0 ? 0.9 : 1.1, -3.0 + 10.0 * t);
      ASSERT_NEAR(sound.pressure_pa[ear][n], 2.0 / r * std::cos(2 * pi * 1000.0 * (t - 0.01 - r / 343.0)), 5e-4 * 2.0 / r)
          << ear << " " << n;
    }
  }
}

// A dipole along z, rotated to x, above a ground that reflects half of the pressure.
TEST(Render, DirectivityAndGroundReflectionMatchTheClosedForm) {
  constexpr double kFreq = 1000.0, kRadius = 0.09, k = 2.0 * pi * kFreq / 343.0;
  Case c({{kFreq, 0.0, 2.0}}, {0.0, 0.0, 0.0}, 0.1);
  testing::give_multipoles(c.bank, {testing::make_dipole(1.0)}, kRadius);
  c.scene.bodies[0].spec.bank = &c.bank;
  const double half = std::sqrt(0.5);
  for (physics::Pose& pose : c.simulation.poses[0]) pose.rotation = {half, 0.0, half, 0.0};
  c.scene.bodies[0].spec.initial.rotation = {half, 0.0, half, 0.0};
  c.scene.microphones_m = {{2.0, 0.0, 0.0}, {0.0, 2.0, 0.0}, {-2.0, 0.0, 0.3}, {1.2, 1.6, 0.0}};
  c.scene.ground.emplace().height_m = -1.0;
  for (const bool reflects : {false, true}) {
    if (reflects) c.scene.reflection = 0.5;
    c.scene.effects = scene::kDefaultEffects.with(synth::Effect::kDirectivity);
    if (reflects) c.scene.effects = c.scene.effects.with(synth::Effect::kGroundReflection);
    const Heard sound = c.render();
    for (std::size_t e = 0; e < c.scene.microphones_m.size(); ++e) {
      std::complex<double> expected;  // of e^{i omega t}
      for (const double level : {1.0, reflects ? 0.5 : 0.0}) {
        Vec3 place = c.scene.microphones_m[e];
        if (level < 1.0) place[2] = -2.0 - place[2];
        const double r = norm(place);
        expected += level * std::conj(testing::calc_dipole_fall(k * r, k * kRadius)) * (place[0] / r);
      }
      for (int n = 9600; n < 23000; ++n) {
        ASSERT_NEAR(sound.pressure_pa[e][n], std::real(expected * std::polar(1.0, 2.0 * pi * kFreq * (n / 48000.0 - 0.1))), 1e-4)
            << e << " " << n;
      }
    }
  }
}

/// A tone of 2 Pa at 1 m, 2 m to the left of a listener that looks along -x.
Case make_case_with_head() {
  Case c({{1500.0, 0.0, 2.0}}, {0.0, -2.0, 0.0}, 0.1);
  c.scene.listener.facing = {-1.0, 0.0, 0.0};
  c.scene.listener.ears = scene::Ears::kHrtf;
  c.scene.listener.ear_distance_m = 0.18;
  c.scene.effects = scene::kDefaultEffects.with(synth::Effect::kHead);
  return c;
}

// The sphere has the width of the ears and the listener's orientation, without latency.
TEST(Render, SphericalHeadHasTheOrientationOfTheListener) {
  const Case c = make_case_with_head();
  const Heard sound = c.render();
  ASSERT_EQ(sound.pressure_pa[0].size(), 24000u);
  constexpr double k = 2.0 * pi * 1500.0 / 343.0;
  for (std::size_t ear = 0; ear < 2; ++ear) {
    const double angle = (ear == 0 ? 10.0 : 170.0) * pi / 180.0;  // ears are 10 degrees behind the middle
    const std::complex<double> at_ear = std::polar(1.0, -2.0 * k) * head::testing::calc_rigid_sphere(k * 0.09, angle);
    for (std::size_t n = 9600; n < 23000; ++n) {
      const double t = static_cast<double>(n) / 48000.0 - 0.1;
      ASSERT_NEAR(sound.pressure_pa[ear][n], std::real(at_ear * std::polar(1.0, 2.0 * pi * 1500.0 * t)), 5e-3) << ear << " " << n;
    }
  }
}

// A head file with a known law: the level of an ear for the direction d is 1 +- 0.5 d_y.
TEST(Render, MeasuredHeadIsReadFromItsFile) {
  if (!head::has_sofa()) GTEST_SKIP() << "built without SOFA";
  const tests::Folder folder;
  Case c = make_case_with_head();
  c.scene.listener.sofa = folder / "head.sofa";
  const std::string script = carillon::tests::get_source_dir() + "/tests/unit/runtime/acoustics/head/write_sofa.py ";
  ASSERT_EQ(std::system(("/usr/bin/python3 " + script + c.scene.listener.sofa.string() + " step=30").c_str()), 0)
      << "python3-h5py is needed";
  const Heard sound = c.render();
  std::array<double, 2> peak{};
  for (std::size_t ear = 0; ear < 2; ++ear)
    for (std::size_t n = 9600; n < 23000; ++n) peak[ear] = std::max(peak[ear], std::abs(static_cast<double>(sound.pressure_pa[ear][n])));
  EXPECT_NEAR(peak[0] / peak[1], 3.0, 0.05);

  std::ofstream(c.scene.listener.sofa) << "no head";
  try {
    c.render();
    FAIL() << "a file that is none was read";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).rfind(c.scene.listener.sofa.string() + ": ", 0), 0u) << error.what();
  }
}

TEST(Render, GivenHeadIsNotReadAgain) {
  if (!head::has_sofa()) GTEST_SKIP() << "built without SOFA";
  Case c = make_case_with_head();
  const Heard wanted = c.render();
  const std::optional<synth::ListeningHead> head = scene::make_head(c.scene, 48000.0);
  c.scene.listener.sofa = "/no/such/head.sofa";
  EXPECT_THROW(c.render(), InputError);
  EXPECT_EQ(calc_sound(c.scene, {&c.bank}, c.list_events(), {.rate_hz = 48000, .head = &head}).pressure_pa, wanted.pressure_pa);
}

TEST(Render, AccelerationNoiseIsADipoleAlongTheImpulse) {
  // The modes of the cube (10 cm, 1 kg) are silent; its click is rho0 c0 a / m times e^{-t/T} (cos t/T - sin t/T) for an impulse of 1 N s
  // along z, rotated to x; T = a / c0, from the travel time of the nearest point of its sphere.
  Case c({{1000.0, 5.0, 0.0}}, {0.0, 0.0, 0.0}, 0.1);
  const double half = std::sqrt(0.5);
  for (physics::Pose& pose : c.simulation.poses[0]) pose.rotation = {half, 0.0, half, 0.0};  // a quarter turn about y: z to x
  c.simulation.impulses[0].duration_s = 2e-4;
  c.scene.microphones_m = {{2.0, 0.0, 0.0}, {0.0, 2.0, 0.0}, {-2.0, 0.0, 0.0}, {1.2, 1.6, 0.0}};
  EXPECT_EQ(c.render().peak_pa, 0.0);  // off by default
  c.scene.effects = synth::EffectSet::all();
  const Heard sound = c.render();
  const double radius = 0.1 * std::cbrt(3.0 / (4.0 * pi)), lag = radius / 343.0;
  double scale = 0.0;
  for (int n = 4700; n < 5400; ++n) {
    const double t = n / 48000.0 - (0.1 - 1e-4) - (2.0 - radius) / 343.0;
    double expected = 0.0, area = 0.0;
    for (int i = 0; i < 1000; ++i) {
      const double x = (i + 0.5) / 1000.0, u = (t - 2e-4 * x) / lag;
      area += std::pow(std::sin(pi * x), 1.5);
      if (u > 0.0) expected += std::pow(std::sin(pi * x), 1.5) * std::exp(-u) * (std::cos(u) - std::sin(u));
    }
    expected *= 1.21 * 343.0 * radius / 1.0 / 2.0 / area;
    scale = std::max(scale, std::abs(expected));
    ASSERT_NEAR(sound.pressure_pa[0][n], expected, 0.1) << n;  // relative to a peak of 12: band limit of the delay
    ASSERT_NEAR(sound.pressure_pa[1][n], 0.0, 1e-5);
    ASSERT_NEAR(sound.pressure_pa[2][n], -sound.pressure_pa[0][n], 1e-5);
    ASSERT_NEAR(sound.pressure_pa[3][n], 0.6 * sound.pressure_pa[0][n], 1e-4);
  }
  EXPECT_GT(scale, 5.0);
  c.scene.bodies[0].spec.fixed = true;  // immovable
  EXPECT_EQ(c.render().peak_pa, 0.0);
}

TEST(Render, EffectsCanBeDisabled) {
  using synth::Effect;
  Case c({{1000.0, 0.0, 2.0}}, {0.0, 3.43, 0.0}, 0.1);
  c.simulation.impulses[0].duration_s = 1e-3;
  c.scene.effects = {Effect::kHertzPulse};
  EXPECT_EQ(c.render().peak_pa, 0.0);
  // An ideal impulse without delay at the centre: 2 / 3.43 cos from 0.1 s on in both channels.
  c.scene.effects = {Effect::kModal};
  c.scene.listener.ear_distance_m = 3.0;
  const Heard sound = c.render();
  EXPECT_EQ(sound.pressure_pa[0], sound.pressure_pa[1]);
  for (int n = 4900; n < 24000; ++n) {
    ASSERT_NEAR(sound.pressure_pa[0][n], 2.0 / 3.43 * std::cos(2 * pi * 1000.0 * (n / 48000.0 - 0.1)), 2e-4) << n;
  }
  // The pulse attenuates by its spectrum; the delay adds 10 ms, without Doppler shift of a receding body.
  c.scene.effects = {Effect::kModal, Effect::kHertzPulse};
  EXPECT_LT(c.render().peak_pa, 0.8 * sound.peak_pa);
  c.scene.effects = {Effect::kModal, Effect::kAirDelay};
  c.simulation.poses[0] = {{0.0, {0.0, 3.43, 0.0}}, {0.5, {0.0, 13.43, 0.0}}};
  const Heard away = c.render();
  for (int n = 5500; n < 23000; ++n) {
    const double t = n / 48000.0;
    ASSERT_NEAR(away.pressure_pa[0][n] * (3.43 + 20.0 * t), 2.0 * std::cos(2 * pi * 1000.0 * (t - 0.11)), 0.13) << n;
  }
}

TEST(Render, NoSoundArrivesBeforeTheTravelTime) {
  const Case c({{1000.0, 5.0, 2.0}}, {0.0, 3.43, 0.0}, 0.1);
  const Heard sound = c.render();
  const std::size_t arrival = (0.1 + std::hypot(3.43, 0.1) / 343.0) * 48000.0;
  for (std::size_t n = 0; n + 16 < arrival; ++n) ASSERT_EQ(sound.pressure_pa[0][n], 0.0) << n;
  EXPECT_GT(std::abs(sound.pressure_pa[0][arrival + 2]), 0.1);
}

TEST(Render, RecedingBodyIsLowerAndSofter) {
  Case c({{1000.0, 0.0, 1.0}}, {0.0, 1.0, 0.0}, 0.001);
  c.simulation.poses[0] = {{0.0, {0.0, 1.0, 0.0}}, {0.25, {0.0, 6.0, 0.0}}, {0.5, {0.0, 11.0, 0.0}}};
  const Heard sound = c.render();
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

TEST(Render, BodyBeyondTheAudibleDistanceIsHarmless) {
  Case c({{1000.0, 1.0, 1.0}}, {0.0, 1.0, 0.0}, 0.001);
  c.simulation.poses[0] = {{0.0, {0.0, 1.0, 0.0}}, {0.1, {0.0, 1.0, -10.0}}, {0.5, {0.0, 1.0, -1e7}}};
  const Heard sound = c.render();
  EXPECT_TRUE(std::isfinite(sound.peak_pa));
  EXPECT_GT(sound.peak_pa, 0.1);
}

TEST(Render, ModesAboveNyquistAreSilent) {
  const Case c({{1000.0, 5.0}, {15000.0, 5.0}, {23999.0, 5.0}, {30000.0, 5.0}}, {0.0, 1.0, 0.0}, 0.1);
  EXPECT_EQ(c.render(48000).modes, 3);
  EXPECT_EQ(c.render(22050).modes, 1);
  EXPECT_EQ(c.render(96000).modes, 4);
}

TEST(Render, SceneWithoutContactsIsSilent) {
  Case c({{1000.0, 5.0}}, {0.0, 1.0, 0.0}, 0.1);
  c.simulation.impulses.clear();
  const Heard sound = c.render();
  EXPECT_EQ(sound.peak_pa, 0.0);
  const Gain gain = calc_gain(c.scene.output, 0.0);
  EXPECT_TRUE(std::isfinite(gain.per_pa));
  const std::string wav = make_wav(keep(sound.pressure_pa, 48000), gain.per_pa, scene::SampleFormat::kPcm24);
  ASSERT_EQ(wav.size() % 2, 0u);
  EXPECT_EQ(wav.find_first_not_of('\0', wav.size() - 24000 * 6), std::string::npos);
  Figures figures;
  c.scene.bodies[0].spec.bank = &c.bank;
  const scene::Plan plan =
      scene::make_plan(scene::make_facts(c.scene, scene::make_microphones(c.scene), true), scene::make_events(c.list_events()));
  EXPECT_NE(make_report_json(c.scene, sound, plan, figures).find("\"mean_db_spl\": null"), std::string::npos);
}

TEST(Render, NonFiniteImpulsesAreIgnoredAndCounted) {
  Case c({{1000.0, 5.0}}, {0.0, 1.0, 0.0}, 0.1);
  physics::Impulse bad = c.simulation.impulses[0];
  bad.impulse_n_s[1] = std::numeric_limits<double>::quiet_NaN();
  c.simulation.impulses.push_back(bad);
  bad = c.simulation.impulses[0];
  bad.body = 7;
  c.simulation.impulses.push_back(bad);
  const Heard sound = c.render();
  EXPECT_EQ(sound.refused, 0);
  EXPECT_EQ(sound.faults, 1);
  EXPECT_EQ(sound.strikes, 1);
  EXPECT_TRUE(std::isfinite(sound.peak_pa));
}

TEST(SoundFile, LibsndfileReadsEveryFormatAndRateBack) {
  struct Format {
    scene::SampleFormat format;
    int subtype;
    double step;
  };
  const Format formats[] = {{scene::SampleFormat::kPcm16, SF_FORMAT_PCM_16, std::pow(2.0, -15)},
                            {scene::SampleFormat::kPcm24, SF_FORMAT_PCM_24, std::pow(2.0, -23)},
                            {scene::SampleFormat::kPcm32, SF_FORMAT_PCM_32, std::pow(2.0, -31)},
                            {scene::SampleFormat::kFloat, SF_FORMAT_FLOAT, std::pow(2.0, -24)}};
  const std::string file = ::testing::TempDir() + "carillon-formats.wav";
  for (const int rate : {8000, 12345, 44100, 48000, 96000, 192000}) {
    std::vector<std::vector<double>> pressure_pa(2);
    for (int n = 0; n < 5000; ++n) {
      pressure_pa[0].push_back(static_cast<float>(4.0 * std::sin(0.37 * n)));
      pressure_pa[1].push_back(n == 17 ? 4.0F : n == 18 ? -4.0F : 1e-6F * static_cast<float>(n));  // full scale must not wrap
    }
    for (const Format& format : formats) {
      std::ofstream(file, std::ios::binary) << make_wav(keep(pressure_pa, rate), 0.25, format.format);
      SF_INFO info{};
      SNDFILE* in = sf_open(file.c_str(), SFM_READ, &info);
      ASSERT_NE(in, nullptr) << sf_strerror(nullptr);
      EXPECT_EQ(info.samplerate, rate);
      EXPECT_EQ(info.channels, 2);
      EXPECT_EQ(info.format, SF_FORMAT_WAV | format.subtype);
      ASSERT_EQ(info.frames, 5000);
      std::vector<double> frames(10000);
      EXPECT_EQ(sf_readf_double(in, frames.data(), 5000), 5000);
      sf_close(in);
      for (std::size_t n = 0; n < 5000; ++n) {
        for (std::size_t ear = 0; ear < 2; ++ear) {
          ASSERT_NEAR(frames[2 * n + ear], 0.25 * pressure_pa[ear][n], 1.01 * format.step) << rate << " " << format.subtype << " " << n;
        }
      }
    }
  }
  std::remove(file.c_str());
}

/// libsndfile's view of a truncated file padded with zeros.
SF_INFO read_info(const std::string& header, std::uint64_t length) {
  struct Source {
    const std::string* header;
    sf_count_t length, at;
  } source{&header, static_cast<sf_count_t>(length), 0};
  SF_VIRTUAL_IO io{};
  io.get_filelen = [](void* user) { return static_cast<Source*>(user)->length; };
  io.seek = [](sf_count_t offset, int whence, void* user) {
    auto& from = *static_cast<Source*>(user);
    return from.at = offset + (whence == SEEK_SET ? 0 : whence == SEEK_CUR ? from.at : from.length);
  };
  io.read = [](void* data, sf_count_t count, void* user) {
    auto& from = *static_cast<Source*>(user);
    count = std::min(count, from.length - from.at);
    for (sf_count_t i = 0; i < count; ++i, ++from.at)
      static_cast<char*>(data)[i] = static_cast<std::size_t>(from.at) < from.header->size() ? (*from.header)[from.at] : '\0';
    return count;
  };
  io.tell = [](void* user) { return static_cast<Source*>(user)->at; };
  SF_INFO info{};
  SNDFILE* in = sf_open_virtual(&io, SFM_READ, &info, &source);
  EXPECT_NE(in, nullptr) << sf_strerror(nullptr);
  if (in != nullptr) sf_close(in);
  return info;
}

TEST(SoundFile, AboveFourGibibytesItIsAnRf64) {
  const struct {
    std::size_t channels;
    scene::SampleFormat format;
    std::uint64_t frames;
    int expected;
  } cases[] = {{2, scene::SampleFormat::kPcm16, 1 << 20, SF_FORMAT_WAV | SF_FORMAT_PCM_16},
               {1, scene::SampleFormat::kPcm24, 1431655750, SF_FORMAT_WAV | SF_FORMAT_PCM_24},  // the last that fits
               {1, scene::SampleFormat::kPcm24, 1431655760, SF_FORMAT_RF64 | SF_FORMAT_PCM_24},
               {2, scene::SampleFormat::kPcm16, 3600ULL * 384000, SF_FORMAT_RF64 | SF_FORMAT_PCM_16},
               {8, scene::SampleFormat::kFloat, 3600ULL * 192000, SF_FORMAT_RF64 | SF_FORMAT_FLOAT},
               {64, scene::SampleFormat::kPcm32, 3600ULL * 192000, SF_FORMAT_RF64 | SF_FORMAT_PCM_32}};
  for (const auto& c : cases) {
    const SF_INFO info = read_info(sound::make_wav_header(192000, c.channels, get_sample_kind(c.format), c.frames),
                                   calc_wav_bytes(c.channels, c.format, c.frames));
    EXPECT_EQ(info.format, c.expected) << c.frames;
    EXPECT_EQ(info.frames, static_cast<sf_count_t>(c.frames));
    EXPECT_EQ(info.channels, static_cast<int>(c.channels));
    EXPECT_EQ(info.samplerate, 192000);
  }
}

TEST(SoundFile, OddNumberOfBytesIsPadded) {
  const std::string wav = make_wav(keep({{0.5, -0.5, 0.25}}, 8000), 1.0, scene::SampleFormat::kPcm24);
  EXPECT_EQ(wav.size() % 2, 0U);
  EXPECT_EQ(wav.back(), '\0');
}

TEST(Render, OnlyASoundThatIsCutOffFades) {
  const auto render = [](const Case& c, bool fades) {
    return calc_sound(c.scene, {&c.bank}, c.list_events(), {.rate_hz = 48000, .fades_end = fades});
  };
  // Two channels at equal distance; a ringing mode, and one that has decayed by 140 dB.
  const Case rings({{1000.0, 1.0, 2.0}}, {0.0, 3.0, 0.0}, 0.1), over({{1000.0, 40.0, 2.0}}, {0.0, 3.0, 0.0}, 0.1);
  const Heard raw = render(rings, false), faded = render(rings, true);
  EXPECT_EQ(raw.faded_s, 0.0);
  EXPECT_NEAR(faded.faded_s, 0.01, 1e-9);
  for (std::size_t ear = 0; ear < 2; ++ear) {
    ASSERT_EQ(faded.pressure_pa[ear].size(), 24000U);
    for (std::size_t n = 0; n < 24000; ++n) {
      const double u = n < 23520 ? 0.0 : (static_cast<double>(n) - 23519.0) / 480.0;
      ASSERT_NEAR(faded.pressure_pa[ear][n], raw.pressure_pa[ear][n] * 0.5 * (1.0 + std::cos(pi * u)), 1e-7) << n;
    }
    EXPECT_EQ(faded.pressure_pa[ear].back(), 0.0);
  }
  EXPECT_GT(std::abs(raw.pressure_pa[0][23990]), 0.1);
  const Heard ended = render(over, true);
  EXPECT_EQ(ended.faded_s, 0.0);
  EXPECT_EQ(ended.pressure_pa, render(over, false).pressure_pa);
  EXPECT_NE(ended.pressure_pa[0].back(), 0.0);
  // A peak within the fade is the peak of the file.
  Case late({{1000.0, 1.0, 2.0}}, {0.0, 1.0, 0.0}, 0.4935);
  const Heard cut = render(late, true);
  double peak = 0.0;
  for (const double p : cut.pressure_pa[0]) peak = std::max(peak, std::abs(p));
  EXPECT_GT(peak, 0.0);
  EXPECT_EQ(cut.peak_pa, peak);
  // Shorter than the fade.
  late.scene.duration_s = 0.004;
  late.simulation.impulses[0].time_s = 0.0;
  late.scene.bodies[0].spec.initial.position_m = {0.0, 0.1, 0.0};
  for (physics::Pose& pose : late.simulation.poses[0]) pose.position_m = {0.0, 0.1, 0.0};
  const Heard brief = render(late, true);
  EXPECT_NEAR(brief.faded_s, 0.004, 1e-9);
  EXPECT_EQ(brief.pressure_pa[0].back(), 0.0);
}

TEST(Render, GainIsAutomaticGivenOrReducedButNeverClips) {
  scene::Output output;
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
  Meter meter(48000, 2);
  for (int n = 0; n < 48000; ++n) {
    const auto p = static_cast<float>(n < 24000 ? std::sqrt(2.0) * std::sin(2 * pi * 1000.0 * n / 48000.0) : 0.0);
    meter.add(std::array{p, p});
  }
  const Levels levels = meter.calc_levels();
  EXPECT_NEAR(levels.loudest_db, 93.979, 0.001);
  EXPECT_NEAR(levels.mean_db, 93.979 - 3.0103, 0.001);
}

TEST(Render, TrajectoryHasThinnedPosesAndPositionsOfImpulses) {
  Case c({{1000.0, 5.0}}, {0.0, 1.0, 0.0}, 0.25);
  c.simulation.poses[0].clear();
  for (int i = 0; i <= 5000; ++i)
    c.simulation.poses[0].push_back({i * 1e-4, {i * 2e-4, 1.0, 0.0}, {std::sqrt(0.5), 0.0, 0.0, std::sqrt(0.5)}});
  const scene::Events events = scene::make_events(c.list_events());
  std::string json;
  write_trajectory(c.scene, {&c.bank}, events, base::Spool(), [&](std::string_view piece) { json += piece; });
  std::size_t rows = 0;
  for (std::size_t at = json.find("\n    ["); at != std::string::npos; at = json.find("\n    [", at + 1)) ++rows;
  EXPECT_LE(rows, 101u);
  EXPECT_GE(rows, 95u);
  EXPECT_NE(json.find("\"height_m\": null"), std::string::npos);
  // Corner 0 is (-0.05, -0.05, -0.05); a quarter turn about z takes it to (0.05, -0.05, -0.05), at t = 0.25 s shifted by (0.5, 1, 0).
  EXPECT_NE(json.find("\"world_m\": [0.55, 0.95, -0.05]"), std::string::npos) << json.substr(json.size() - 300);
  EXPECT_EQ(scene::count_impulses(events, 1).contacts, 1);
}

}  // namespace
}  // namespace carillon::render

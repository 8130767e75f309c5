// Recorded surfaces in a scene: small balls in closed form, next to a modal body, resampled, with a head, and invalid files.
#include "runtime/render/surface_playback.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/scene/scene.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/runtime/acoustics/recording/make_surface.hpp"
#include "tests/unit/runtime/render/heard.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::render {
namespace {

using recording::testing::Ball;
constexpr double kTwoPi = 2.0 * std::numbers::pi;

Ball make_tone(double freq_hz) {
  Ball ball;
  ball.acceleration_m_s2 = [freq_hz](double t) { return 1e3 * std::sin(kTwoPi * freq_hz * t); };
  return ball;
}

class Surfaces : public ::testing::Test {
 protected:
  /// A scene of 0.1 s at 48 kHz with these bodies and root keys.
  scene::Scene read(const std::string& bodies, const std::string& root = R"("microphones": [[0.5, 0, 0], [0, 0.7, 0.2]])") {
    scene::Scene scene = scene::parse_scene(
        base::parse_document("{\"duration_s\": 0.1, \"bodies\": [" + bodies + "], " + root + "}", folder / "scene.json"));
    read_surfaces(scene);
    return scene;
  }
  void write(const std::string& name, const Ball& ball, const recording::testing::BallOptions& options = {}) {
    folder.write(name, recording::testing::make_ball_surface(ball, options));
  }
  static std::vector<std::vector<double>> hear(const scene::Scene& scene) {
    return calc_sound(scene, {}, {}, {.rate_hz = 48000}).pressure_pa;
  }

  tests::Folder folder;
};

void expect_close(const std::vector<double>& sound, const std::function<double(double)>& wanted, double tolerance_db,
                  std::size_t begin = 0) {
  double error = 0.0, power = 0.0;
  for (std::size_t n = begin; n < sound.size(); ++n) {
    const double p = wanted(static_cast<double>(n) / 48000.0);
    error += std::pow(sound[n] - p, 2);
    power += p * p;
  }
  EXPECT_GT(power, 0.0);
  EXPECT_LT(10.0 * std::log10(error / power), tolerance_db);
}

TEST_F(Surfaces, BallHasThePositionAndStartOfTheScene) {
  const Ball ball = make_tone(700.0);
  Ball shifted = ball;
  shifted.centre_m = [](double) { return Vec3{0.2, 0.0, 0.0}; };
  write("ball.surface.hdf", shifted);
  // Rotated by a quarter about z, (0.2, 0, 0) is at (0, 0.2, 0).
  const scene::Scene scene = read(R"({"name": "b", "recording": "ball.surface.hdf", "start_s": 0.01, "position_m": [0, -0.1, 0.3],
                              "rotation_deg": [0, 0, 90], "gain": 3, "high_pass_hz": 0})");
  const auto sound = hear(scene);
  ASSERT_EQ(sound.size(), 2U);
  ASSERT_EQ(sound[0].size(), 4800U);
  const Vec3 place{0.0, 0.1, 0.3};
  for (std::size_t m = 0; m < 2; ++m)
    expect_close(
        sound[m], [&](double t) { return 3.0 * recording::testing::calc_ball_pressure(ball, scene.microphones_m[m] - place, t - 0.01); },
        -50.0);
}

TEST_F(Surfaces, TwoRecordingsAdd) {
  write("a.surface.hdf", make_tone(700.0));
  write("b.surface.hdf", make_tone(1900.0));
  const std::string a = R"({"name": "a", "recording": "a.surface.hdf", "position_m": [0, 0, 1]})";
  const std::string b = R"({"name": "b", "recording": "b.surface.hdf", "start_s": 0.02})";
  const auto one = hear(read(a)), other = hear(read(b)), both = hear(read(a + "," + b));
  for (std::size_t m = 0; m < 2; ++m)
    for (std::size_t n = 0; n < both[m].size(); ++n)
      ASSERT_NEAR(both[m][n], one[m][n] + other[m][n], 2e-7 * (std::abs(one[m][n]) + std::abs(other[m][n]))) << m << " " << n;
}

TEST_F(Surfaces, ModalBodyNextToItIsUnchanged) {
  write("a.surface.hdf", make_tone(700.0));
  const bank::Bank bank = testing::make_cube_bank({{1000.0, 5.0, 2.0}, {2310.0, 8.0, 1.0}});
  const std::string cube = R"({"name": "cube", "bank": "cube.hdf", "fixed": true})";
  const std::string root = R"("strikes": [{"time_s": 0.01, "body": "cube", "triangle": 0, "impulse_n_s": [0, 0, 0.001]}])";
  const auto play = [&](const std::string& bodies, bool has_cube) {
    scene::Scene scene = read(bodies, has_cube ? root : R"("gravity_m_s2": [0, 0, 0])");
    std::vector<events::Event> events;
    std::vector<const bank::Bank*> banks;
    if (has_cube) {
      scene.bodies[0].spec.bank = &bank;
      banks.push_back(&bank);
      events.emplace_back(
          events::Impulse{.time_s = 0.01, .body = 0, .triangle = 0, .barycentric = {1, 0, 0}, .impulse_n_s = {0, 0, 0.001}});
    }
    return calc_sound(scene, banks, events, {.rate_hz = 48000}).pressure_pa;
  };
  const std::string ball = R"({"name": "a", "recording": "a.surface.hdf", "position_m": [0.4, 0, 0]})";
  const auto alone = play(cube, true), recorded = play(ball, false), both = play(ball + "," + cube, true);
  double most = 0.0;
  for (std::size_t m = 0; m < 2; ++m)
    for (std::size_t n = 0; n < both[m].size(); ++n) {
      const float sum = static_cast<float>(alone[m][n]) + static_cast<float>(recorded[m][n]);
      ASSERT_EQ(static_cast<float>(both[m][n]), sum) << m << " " << n;
      most = std::max(most, std::min(std::abs(alone[m][n]), std::abs(recorded[m][n])));
    }
  EXPECT_GT(most, 1e-6);
}

TEST_F(Surfaces, LoopRepeats) {
  Ball ball = make_tone(800.0);  // 160 periods in 0.2 s
  write("a.surface.hdf", ball, {.frames = 9600});
  scene::Scene scene = read(R"({"name": "a", "recording": "a.surface.hdf", "loop": true, "high_pass_hz": 0})");
  scene.duration_s = 0.5;
  const auto sound = hear(scene);
  ASSERT_EQ(sound[0].size(), 24000U);
  for (std::size_t n = 600; n + 9600 < sound[0].size(); ++n)
    ASSERT_NEAR(sound[0][n + 9600], sound[0][n], 1e-6 + 2e-3 * std::abs(sound[0][n]));
}

TEST_F(Surfaces, OtherRatesAreResampled) {
  const Ball ball = make_tone(3000.0);
  for (const double rate_hz : {44100.0, 96000.0, 16000.0}) {
    write("a.surface.hdf", ball, {.rate_hz = rate_hz, .frames = static_cast<std::uint64_t>(0.1 * rate_hz)});
    const scene::Scene scene = read(R"({"name": "a", "recording": "a.surface.hdf", "high_pass_hz": 0})");
    const auto sound = hear(scene);
    // ka = 0.06 for a ball of 1 mm.
    expect_close(
        sound[0], [&](double t) { return recording::testing::calc_ball_pressure(ball, scene.microphones_m[0], t); }, -40.0, 400);
    EXPECT_NE(describe_surface(scene, scene.surfaces[0]).find("to 48000 Hz, since the scene has that rate"), std::string::npos);
  }
}

TEST_F(Surfaces, GroundReflectsIt) {
  const Ball ball = make_tone(900.0);
  write("a.surface.hdf", ball);
  const std::string body = R"({"name": "a", "recording": "a.surface.hdf", "position_m": [0, 0, 0.3], "high_pass_hz": 0})";
  const std::string root = R"("ground": {"reflection": 0.8}, "microphones": [[0.5, 0, 0.4]])";
  const auto sound = hear(read(body, root));
  expect_close(
      sound[0],
      [&](double t) {
        return recording::testing::calc_ball_pressure(ball, {0.5, 0.0, 0.1}, t) +
               0.8 * recording::testing::calc_ball_pressure(ball, {0.5, 0.0, -0.7}, t);
      },
      -50.0);
  const auto without = hear(read(body, root + R"(, "effects": {"off": ["ground_reflection"]})"));
  expect_close(
      without[0],
      [&](double t) {
        return recording::testing::calc_ball_pressure(ball, {0.5, 0.0, 0.1}, t);
      },
      -50.0);
}

/// Amplitude and phase of a tone in the second half of a sound.
std::complex<double> find_tone(const std::vector<double>& sound, double freq_hz) {
  std::complex<double> sum;
  for (std::size_t n = sound.size() - 2400; n < sound.size(); ++n)
    sum += sound[n] * std::polar(1.0, -kTwoPi * freq_hz * static_cast<double>(n) / 48000.0);
  return sum;
}

TEST_F(Surfaces, HeadHearsItLikeAModalBody) {
  const double freq_hz = 1000.0;
  write("a.surface.hdf", make_tone(freq_hz));
  const std::string root = R"("listener": {"position_m": [0, 0, 0], "ears": "hrtf"})", at = R"("position_m": [-1.2, 0.8, 0.3])";
  const scene::Scene recorded = read(R"({"name": "a", "recording": "a.surface.hdf", )" + at + "}", root);
  scene::Scene modal = read(R"({"name": "cube", "bank": "cube.hdf", "fixed": true, )" + at + "}", root);
  const bank::Bank bank = testing::make_cube_bank({{freq_hz, 0.0, 2.0}});
  modal.bodies[0].spec.bank = &bank;
  const auto one = hear(recorded);
  const auto other =
      calc_sound(modal, {&bank},
                 {events::Impulse{.time_s = 0.01, .body = 0, .triangle = 0, .barycentric = {1, 0, 0}, .impulse_n_s = {0, 0, 1}}},
                 {.rate_hz = 48000})
          .pressure_pa;
  const auto ratio = find_tone(one[0], freq_hz) / find_tone(one[1], freq_hz),
             wanted = find_tone(other[0], freq_hz) / find_tone(other[1], freq_hz);
  EXPECT_GT(std::abs(wanted), 1.2);  // the left ear is nearer
  EXPECT_LT(std::abs(ratio / wanted - 1.0), 5e-3);
  EXPECT_NE(describe_surface(recorded, recorded.surfaces[0]).find("the listener's head"), std::string::npos);
  // Arrival time as with free ears: the delay is that of the distance to the centre of the head.
  const double late = std::arg(find_tone(one[0], freq_hz) * find_tone(one[1], freq_hz));
  const double distance_m = std::hypot(1.2, 0.8, 0.3);
  const double free = std::arg(std::pow(std::polar(1.0, -kTwoPi * freq_hz * distance_m / 343.0 - 0.5 * std::numbers::pi), 2));
  EXPECT_LT(std::abs(std::remainder(late - free, kTwoPi)), 1.2);  // phases of the head alone; its latency of 0.9 ms would be 11 rad
}

TEST_F(Surfaces, AmbisonicsEncodeItsDirection) {
  const Ball ball = make_tone(900.0);
  write("a.surface.hdf", ball);
  const std::string body = R"({"name": "a", "recording": "a.surface.hdf", "position_m": [-0.3, 0.4, 1.2], "high_pass_hz": 0})";
  const scene::Scene scene = read(body, R"("listener": {"position_m": [0, 0, 0], "facing": [0, 1, 0], "ears": "ambisonic", "order": 2})");
  const auto sound = hear(scene), point = hear(read(body, R"("microphones": [[0, 0, 0]])"));
  ASSERT_EQ(sound.size(), 9U);
  EXPECT_EQ(sound[0], point[0]);
  // 0.4 m ahead, 0.3 m to the left, 1.2 m up.
  const double gains[] = {1.0,
                          3.0 / 13.0,
                          12.0 / 13.0,
                          4.0 / 13.0,
                          std::sqrt(3.0) * 12.0 / 169.0,
                          std::sqrt(3.0) * 36.0 / 169.0,
                          (3.0 * 144.0 / 169.0 - 1.0) / 2.0,
                          std::sqrt(3.0) * 48.0 / 169.0,
                          std::sqrt(3.0) / 2.0 * 7.0 / 169.0};
  for (std::size_t c = 0; c < 9; ++c)
    for (std::size_t n = 0; n < point[0].size(); ++n)
      ASSERT_NEAR(sound[c][n], gains[c] * point[0][n], 1e-6 * std::abs(point[0][n]) + 1e-12) << c << " " << n;
  EXPECT_NE(describe_surface(scene, scene.surfaces[0]).find("in Ambisonics of order 2"), std::string::npos);
}

TEST_F(Surfaces, InvalidInputIsOneError) {
  write("a.surface.hdf", make_tone(700.0), {.frames = 480});
  const std::string bytes = tests::read_all(folder / "a.surface.hdf");
  folder.write("cut.surface.hdf", bytes.substr(0, 9000));
  folder.write("text.surface.hdf", "not a surface");
  const auto fail = [&](const std::string& keys) {
    return tests::catch_message<InputError>([&] { read(R"({"name": "a", )" + keys + "}"); });
  };
  const auto expect = [&](const std::string& keys, const std::string& part) {
    const std::string message = fail(keys);
    EXPECT_NE(message.find(part), std::string::npos) << message;
    EXPECT_NE(message.find("scene.json:"), std::string::npos) << message;
  };
  expect(R"("recording": "none.surface.hdf")", "cannot be opened");
  expect(R"("recording": "cut.surface.hdf")", "truncated: 9000 bytes");
  expect(R"("recording": "text.surface.hdf")", "not a recorded surface");
  expect(R"("recording": "a.surface.hdf", "start_s": 0.1)", "begins at 0.1 s, and the scene ends at 0.1 s");
  expect(R"("recording": "a.surface.hdf", "start_s": -1)", "out of range");
  expect(R"("recording": "a.surface.hdf", "loop": true)", "a \"loop\" takes one of at least 0.1 s");
  expect(R"("recording": "a.surface.hdf", "bank": "a.hdf")", "keep one of them");
  expect(R"("recording": "a.surface.hdf", "gain": -1)", "out of range");
  expect(R"("recording": "a.surface.hdf", "fixed": true)", "fixed");
  const std::string body = R"({"name": "a", "recording": "a.surface.hdf"})";
  EXPECT_NE(tests::catch_message<InputError>([&] {
              read(body, R"("strikes": [{"time_s": 0.01, "body": "a", "triangle": 0, "impulse_n_s": [0, 0, 1]}])");
            }).find("\"a\" is a recording, which cannot be struck"),
            std::string::npos);
  EXPECT_NE(tests::catch_message<InputError>([&] { read(body + "," + body); }).find("already"), std::string::npos);
  EXPECT_NE(tests::catch_message<InputError>([&] { refuse_surfaces(read(body), "carillon-live"); }).find("carillon-live cannot play"),
            std::string::npos);
  Ball loud = make_tone(700.0);
  loud.acceleration_m_s2 = [](double) { return 1e15; };
  write("a.surface.hdf", loud);
  EXPECT_NE(tests::catch_message<InputError>([&] { hear(read(body)); }).find("which is implausible; give it another place"),
            std::string::npos);
}

}  // namespace
}  // namespace carillon::render

// Moving receivers against resting ones and the closed form of a small ball.
#include "runtime/acoustics/recording/player.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/unit/runtime/acoustics/recording/make_surface.hpp"

namespace carillon::recording {
namespace {

using testing::Ball;

Ball make_tone(double freq_hz) {
  Ball ball;
  ball.acceleration_m_s2 = [freq_hz](double t) { return 1e3 * std::sin(2.0 * std::numbers::pi * freq_hz * t); };
  return ball;
}

std::vector<double> play(const RecordedSurface& recording, const Way& way, std::vector<std::size_t> counts) {
  Player player(recording, 1);
  std::vector<double> sound;
  for (const std::size_t count : counts) {
    std::vector<double> out(count, 0.0);
    player.play(way, count, out);
    sound.insert(sound.end(), out.begin(), out.end());
  }
  return sound;
}

/// Listener passing on a curve at 10 to 25 m/s.
MovingMicrophone find_listener(double t) {
  MovingMicrophone at;
  at.receiver.place_m = {-0.6 + 15.0 * t + 50.0 * t * t, 0.5, 0.1 + 10.0 * t};
  at.velocity_m_s = {15.0 + 100.0 * t, 0.0, 10.0};
  return at;
}

TEST(Player, AMovingReceiverHearsTheRestingOneAtItsPlace) {
  Ball ball = make_tone(1500.0);
  ball.centre_m = [](double t) { return Vec3{0.3 * std::sin(20.0 * t), 8.0 * t, 0.0}; };
  const std::string bytes = testing::make_ball_surface(ball);
  const RecordedSurface recording(bytes, "ball");
  const auto moving = play(recording, [](std::size_t, double t) { return find_listener(t); }, {4800});
  double error = 0.0, power = 0.0;
  for (std::size_t n = 600; n < 4700; n += 100) {
    const MovingMicrophone there{find_listener(static_cast<double>(n) / 48000.0).receiver, {}};
    const auto still = play(recording, [&](std::size_t, double) { return there; }, {n + 1});
    error += std::pow(moving[n] - still[n], 2);
    power += still[n] * still[n];
  }
  RecordProperty("error_db", std::to_string(10.0 * std::log10(error / power)));
  EXPECT_LT(error, 1e-6 * power);
}

TEST(Player, AMovingReceiverHearsTheClosedForm) {
  // Doppler shift and no change of level: the source is at rest. ka = 0.02: a ball of 1 mm is a point to 1e-3.
  const Ball ball = make_tone(1000.0);
  const std::string bytes = testing::make_ball_surface(ball);
  const RecordedSurface recording(bytes, "ball");
  const auto sound = play(recording, [](std::size_t, double t) { return find_listener(t); }, {4800});
  double error = 0.0, power = 0.0;
  for (std::size_t n = 600; n < 4700; ++n) {
    const double time_s = static_cast<double>(n) / 48000.0;
    const double wanted = testing::calc_ball_pressure(ball, find_listener(time_s).receiver.place_m, time_s);
    error += std::pow(sound[n] - wanted, 2);
    power += wanted * wanted;
  }
  RecordProperty("error_db", std::to_string(10.0 * std::log10(error / power)));
  EXPECT_LT(error, 1e-5 * power);
}

TEST(Player, CallsOfAnySizeGiveTheSameBitsAndAnEnd) {
  const std::string bytes = testing::make_ball_surface(make_tone(1000.0), {.frames = 700});
  const RecordedSurface recording(bytes, "ball");
  const Way way = [](std::size_t, double t) { return find_listener(t); };
  EXPECT_EQ(play(recording, way, {1000}), play(recording, way, {1, 30, 17, 452, 500}));
  Player player(recording, 1);
  std::vector<double> out(1000, 0.0);
  EXPECT_FALSE(player.is_over());
  player.play(way, 500, out);
  EXPECT_FALSE(player.is_over());
  player.play(way, 1000, out);
  EXPECT_TRUE(player.is_over());
}

}  // namespace
}  // namespace carillon::recording

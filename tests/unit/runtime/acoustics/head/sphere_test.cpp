// make_sphere() against the field around a rigid sphere, and laws of interaural delay.
#include "runtime/acoustics/head/sphere.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "runtime/bank/bank.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/runtime/acoustics/head/oracle.hpp"

namespace carillon::head {
namespace {

using std::numbers::pi;
using namespace testing;

constexpr std::array<std::array<double, 2>, 12> kTwelve{{{0, 0},
                                                         {30, 0},
                                                         {77.3, 0},
                                                         {100, 0},
                                                         {150, 20},
                                                         {180, 0},
                                                         {-41.7, 35},
                                                         {-100, 0},
                                                         {-130, -50},
                                                         {12, 80},
                                                         {0, 90},
                                                         {-80, 5}}};  // degrees

TEST(Sphere, SpeedOfSoundIsThatOfBanks) { EXPECT_EQ(Sphere().sound_speed_m_s, bank::kSoundSpeedMs); }

TEST(Sphere, SeriesIsTheFieldOfARigidSphere) {
  for (const double ka : {0.01, 0.3, 1.0, 3.0, 10.0, 25.0, 60.0}) {
    const std::vector<Complex> coefficients = calc_sphere_coefficients(ka);
    for (const double angle : {0.0, 0.4, 1.5, 2.7, pi}) {
      Complex sum = 0.0;
      for (std::size_t m = 0; m < coefficients.size(); ++m)
        sum += coefficients[m] * std::legendre(static_cast<unsigned>(m), std::cos(angle));
      EXPECT_LT(std::abs(sum - calc_rigid_sphere(ka, angle)), 1e-7) << ka << " " << angle;
    }
  }
  EXPECT_NEAR(std::abs(calc_rigid_sphere(60.0, 0.0)), 2.0, 0.01);  // a wall
}

// Quadrature over all directions; a sphere is transparent at low frequencies.
TEST(Sphere, MeanPowerIsThatOverAllDirections) {
  for (const double ka : {0.1, 1.0, 5.0}) {
    double sum = 0.0;
    constexpr int kSteps = 4000;
    for (int i = 0; i < kSteps; ++i) sum += std::norm(calc_rigid_sphere(ka, std::acos((2.0 * i + 1.0) / kSteps - 1.0))) / kSteps;
    EXPECT_NEAR(calc_sphere_mean_power(ka), sum, 1e-5 * sum) << ka;
  }
  EXPECT_NEAR(calc_sphere_mean_power(1e-3), 1.0, 1e-5);
}

/// Common sample rates: level within 0.5 dB to 16 kHz if above -40 dB, and phase.
class Rates : public ::testing::TestWithParam<double> {};
TEST_P(Rates, EarsHearTheFieldOfARigidSphere) {
  const double rate = GetParam();
  const Sphere sphere;
  const auto head = make_sphere(rate, sphere);
  double worst_db = 0.0, worst_rad = 0.0;
  int compared = 0;
  for (const auto& [azimuth, elevation] : kTwelve) {
    const Vec3 direction = make_direction(azimuth, elevation);
    const Heard heard = hear_pulse(head, direction);
    for (const double side : {1.0, -1.0}) {
      const Vec3 ear = make_direction(side * sphere.ear_azimuth_deg, 0.0);
      const double angle = std::acos(std::clamp(dot(ear, direction), -1.0, 1.0));
      for (double freq = 50.0; freq <= 16000.0; freq *= 1.07) {
        const Complex wanted = calc_rigid_sphere(2.0 * pi * freq * sphere.radius_m / kSoundSpeedMs, angle);
        if (std::abs(wanted) < 0.01) continue;
        const Complex found = calc_spectrum(side > 0.0 ? heard.left : heard.right, freq, rate, head->get_latency());
        worst_db = std::max(worst_db, std::abs(20.0 * std::log10(std::abs(found / wanted))));
        worst_rad = std::max(worst_rad, std::abs(std::arg(found / wanted)));
        ++compared;
      }
    }
  }
  EXPECT_LT(worst_db, 0.5);
  EXPECT_LT(worst_rad, 0.06);
  EXPECT_GT(compared, 1900);
}
INSTANTIATE_TEST_SUITE_P(Sphere, Rates, ::testing::Values(44100.0, 48000.0, 96000.0, 192000.0));

TEST(Sphere, LowFrequenciesPassUnchanged) {
  const auto head = make_sphere(48000.0);
  for (const auto& [azimuth, elevation] : kTwelve) {
    const Heard heard = hear_pulse(head, make_direction(azimuth, elevation));
    for (const auto& samples : {heard.left, heard.right})
      EXPECT_NEAR(20.0 * std::log10(std::abs(calc_spectrum(samples, 20.0, 48000.0, 0.0))), 0.0, 0.02) << azimuth << " " << elevation;
  }
}

// Kuhn 1977: 3 a sin(azimuth) / c at low frequencies, a (sin(azimuth) + azimuth) / c at high ones, for ears at both ends of a diameter.
TEST(Sphere, InterauralDelayIsThatOfKuhnAndWoodworth) {
  const Sphere sphere{.ear_azimuth_deg = 90.0};
  const auto head = make_sphere(48000.0, sphere);
  const double a_c = sphere.radius_m / kSoundSpeedMs;
  for (const double azimuth : {15.0, 30.0, 45.0, 60.0, 75.0}) {
    const Heard heard = hear_pulse(head, make_direction(azimuth, 0.0));
    double phase = 0.0, delay = 0.0;
    for (double freq = 50.0; freq <= 16000.0; freq += 50.0) {
      const Complex ratio = calc_spectrum(heard.left, freq, 48000.0, 0.0) / calc_spectrum(heard.right, freq, 48000.0, 0.0);
      phase += std::remainder(std::arg(ratio) - phase, 2.0 * pi);
      delay = phase / (2.0 * pi * freq);
      if (freq == 100.0) {
        EXPECT_NEAR(delay, 3.0 * a_c * std::sin(azimuth * pi / 180.0), 20e-6) << azimuth;
      }
    }
    EXPECT_NEAR(delay, a_c * (std::sin(azimuth * pi / 180.0) + azimuth * pi / 180.0), 20e-6) << azimuth;
  }
}

TEST(Sphere, ASourceInTheMiddlePlaneIsTheSameForBothEars) {
  const auto head = make_sphere(48000.0);
  for (const double elevation : {-60.0, 0.0, 25.0, 90.0, 140.0, 180.0}) {
    Vec3 direction = make_direction(0.0, elevation);
    direction[1] = 0.0;
    const Heard heard = hear_pulse(head, direction);
    EXPECT_EQ(heard.left, heard.right) << elevation;
  }
}

TEST(Sphere, LeftAndRightAreMirrored) {
  const auto head = make_sphere(44100.0);
  for (const auto& [azimuth, elevation] : kTwelve) {
    const Vec3 direction = make_direction(azimuth, elevation);
    const Heard one = hear_pulse(head, direction), other = hear_pulse(head, {direction[0], -direction[1], direction[2]});
    EXPECT_EQ(one.left, other.right);
    EXPECT_EQ(one.right, other.left);
  }
  const Heard left = hear_pulse(head, {0.0, 1.0, 0.0});  // y is left
  double near = 0.0, far = 0.0;
  for (std::size_t n = 0; n < left.left.size(); ++n) {
    near += left.left[n] * left.left[n];
    far += left.right[n] * left.right[n];
  }
  EXPECT_GT(near, 5.0 * far);
}

TEST(Sphere, RefusesImpossibleParameters) {
  EXPECT_THROW(make_sphere(0.0), InputError);
  EXPECT_THROW(make_sphere(std::numeric_limits<double>::quiet_NaN()), InputError);
  EXPECT_THROW(make_sphere(1e9), InputError);
  EXPECT_THROW(make_sphere(48000.0, {.radius_m = 0.0}), InputError);
  EXPECT_THROW(make_sphere(48000.0, {.ear_azimuth_deg = 200.0}), InputError);
  EXPECT_THROW(make_sphere(48000.0, {.sound_speed_m_s = -1.0}), InputError);
}

}  // namespace
}  // namespace carillon::head

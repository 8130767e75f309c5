#include "runtime/synth/acceleration_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <sstream>

#include "runtime/base/error.hpp"
#include "tests/support/paths.hpp"

namespace carillon::synth {
namespace {

constexpr events::Quaternion kUpright{1.0, 0.0, 0.0, 0.0};

using Dipole = std::array<std::vector<float>, 3>;

Dipole play(AccelerationNoise& click, std::size_t samples, std::size_t block = 64) {
  Dipole dipole;
  for (auto& axis : dipole) axis.resize(samples, 99.0F);
  for (std::size_t n = 0; n < samples; n += block) {
    const std::size_t count = std::min(block, samples - n);
    click.process({std::span(dipole[0]).subspan(n, count), std::span(dipole[1]).subspan(n, count), std::span(dipole[2]).subspan(n, count)});
  }
  return dipole;
}

struct Row {
  double radius, mass, duration, t, pressure;
};

std::vector<Row> read_rows() {
  std::ifstream in(carillon::tests::get_source_dir() + "/tests/unit/runtime/synth/data/click.csv");
  std::string line;
  std::getline(in, line);
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    for (char& c : line) c = c == ',' ? ' ' : c;
    std::istringstream words(line);
    Row row{};
    words >> row.radius >> row.mass >> row.duration >> row.t >> row.pressure;
    rows.push_back(row);
  }
  return rows;
}

TEST(AccelerationNoise, ASphereClicksAsItsClosedFormDoes) {
  // 200 rows 2.5 us apart for each of three spheres, from 2 mm (T = 5.8 us, a fraction of a sample) to 0.3 m (T = 0.87 ms).
  const std::vector<Row> rows = read_rows();
  ASSERT_EQ(rows.size(), 600u);
  for (std::size_t first = 0; first < rows.size(); first += 200) {
    const Row& sphere = rows[first];
    double peak = 0.0;
    for (std::size_t i = first; i < first + 200; ++i) peak = std::max(peak, std::abs(rows[i].pressure));
    for (const int every : {1, 4, 8}) {  // 400, 100 and 50 kHz
      for (const int offset : {0, 3}) {
        const double rate = 400e3 / every;
        AccelerationNoise click(sphere.radius, sphere.mass, rate);
        // Samples n = 20, 21 ... are the rows offset, offset + every ...: the force begins `offset` rows before sample 20, less the lead.
        const double begin = 20.0 / rate - offset * 2.5e-6 + sphere.radius / 343.0;
        events::Impulse impulse{.time_s = begin + 0.5 * sphere.duration, .impulse_n_s = {0.0, 1.0, 0.0}, .duration_s = sphere.duration};
        ASSERT_TRUE(click.strike(impulse, kUpright));
        const Dipole dipole = play(click, 220);
        for (std::size_t n = 0; n <= 20; ++n) {
          if (every * (static_cast<int>(n) - 20) + offset <= 0) {
            ASSERT_NEAR(dipole[1][n], 0.0, 1e-6 * peak) << n;
          }
        }
        for (std::size_t i = static_cast<std::size_t>(offset), n = 20; i < 200; i += static_cast<std::size_t>(every), ++n) {
          ASSERT_NEAR(dipole[1][n], rows[first + i].pressure, 1e-6 * peak) << sphere.radius << " m, " << rate << " Hz, row " << i;
          ASSERT_EQ(dipole[0][n], 0.0F);
          ASSERT_EQ(dipole[2][n], 0.0F);
        }
      }
    }
  }
}

TEST(AccelerationNoise, ASphereOfOneCentimetreRingsAt5459HertzFor29Microseconds) {
  constexpr double kRate = 20e6;
  AccelerationNoise click(0.01, 1.0, kRate);
  click.strike({.time_s = 0.01 / 343.0 + 1e-6, .impulse_n_s = {0.0, 0.0, 1.0}}, kUpright);
  const Dipole dipole = play(click, 6000);
  std::vector<double> crossings;
  for (std::size_t n = 40; n + 1 < 6000; ++n) {
    const double a = dipole[2][n], b = dipole[2][n + 1];
    if (a * b < 0.0) crossings.push_back(static_cast<double>(n) + a / (a - b));
  }
  ASSERT_GE(crossings.size(), 3u);
  const double half_period = (crossings[2] - crossings[1]) / kRate;
  EXPECT_NEAR(0.5 / half_period, 5459.0, 0.5);
  const auto at = [&](double sample) { return std::abs(dipole[2][std::lround(sample)]); };
  const double quarter = 0.5 * half_period * kRate;
  const double decay = half_period / std::log(at(crossings[0] + quarter) / at(crossings[1] + quarter));
  EXPECT_NEAR(decay * 1e6, 29.15, 0.05);
}

TEST(AccelerationNoise, TheImpulseIsTurnedIntoTheWorld) {
  AccelerationNoise turned(0.02, 0.05, 48000.0), straight(0.02, 0.05, 48000.0);
  const double half = std::sqrt(0.5);
  const events::Impulse impulse{.time_s = 1e-3, .impulse_n_s = {0.3, 0.4, 0.5}, .duration_s = 1e-4};
  turned.strike(impulse, {half, 0.0, 0.0, half});  // a quarter turn about z: x to y, y to -x
  straight.strike(impulse, kUpright);
  const Dipole a = play(turned, 200), b = play(straight, 200);
  for (std::size_t n = 0; n < 200; ++n) {
    ASSERT_NEAR(a[1][n], b[0][n], 1e-6);
    ASSERT_NEAR(a[0][n], -b[1][n], 1e-6);
    ASSERT_NEAR(a[2][n], b[2][n], 1e-6);
  }
}

TEST(AccelerationNoise, BlockSizesDoNotChangeABit) {
  const auto make = [](std::size_t block) {
    AccelerationNoise click(0.012, 0.02, 44100.0);
    for (int i = 0; i < 9; ++i) {
      click.strike({.time_s = 2e-3 + 7.7e-4 * i, .impulse_n_s = {0.1 * i, -0.2, 0.01 * i * i}, .duration_s = 5e-5 * i}, kUpright);
    }
    return play(click, 2000, block);
  };
  const Dipole one = make(1);
  for (const std::size_t block : {7u, 64u, 511u, 2000u}) EXPECT_EQ(make(block), one) << block;
}

TEST(AccelerationNoise, ABodyAtRestIsSilentAndSleeps) {
  AccelerationNoise click(0.012, 0.02, 48000.0);
  EXPECT_FALSE(click.is_awake());
  click.strike({.time_s = 1e-3, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = 1e-4}, kUpright);
  const Dipole dipole = play(click, 400);
  EXPECT_FALSE(click.is_awake());
  EXPECT_EQ(dipole[2][399], 0.0F);
  // A push that ends leaves no steady pressure behind: all of it is +- and sums to nothing.
  double sum = 0.0, size = 0.0;
  for (const float p : dipole[2]) {
    sum += p;
    size += std::abs(p);
  }
  EXPECT_LT(std::abs(sum), 1e-3 * size);
}

TEST(AccelerationNoise, WhatIsNoPushIsRefused) {
  AccelerationNoise click(0.012, 0.02, 48000.0, 2);
  events::Impulse impulse{.time_s = 1e-3, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = 1e-4};
  events::Impulse bad = impulse;
  bad.impulse_n_s[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(click.strike(bad, kUpright));
  bad = impulse;
  bad.duration_s = -1.0;
  EXPECT_FALSE(click.strike(bad, kUpright));
  EXPECT_TRUE(click.strike(impulse, kUpright));
  EXPECT_TRUE(click.strike(impulse, kUpright));
  EXPECT_FALSE(click.strike(impulse, kUpright));  // no room
  EXPECT_EQ(click.get_refused(), 3);
  EXPECT_THROW(AccelerationNoise(0.0, 1.0, 48000.0), InputError);
  EXPECT_THROW(AccelerationNoise(0.1, -1.0, 48000.0), InputError);
  EXPECT_THROW(AccelerationNoise(0.1, 1.0, std::nan("")), InputError);
}

}  // namespace
}  // namespace carillon::synth

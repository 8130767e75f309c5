// Tones at other sample rates, against the same tones.
#include "runtime/acoustics/recording/resampler.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace carillon::recording {
namespace {

std::vector<double> resample(double from_hz, double to_hz, double freq_hz, std::vector<std::size_t> counts) {
  Resampler resampler(from_hz, to_hz);
  std::vector<double> all;
  std::size_t given = 0;
  for (const std::size_t count : counts) {
    std::vector<double> input(resampler.count_missing(count)), output(count);
    for (double& x : input) x = std::cos(2.0 * std::numbers::pi * freq_hz * static_cast<double>(given++) / from_hz);
    resampler.add(input);
    EXPECT_EQ(resampler.count_missing(count), 0U);
    resampler.take(output);
    all.insert(all.end(), output.begin(), output.end());
  }
  return all;
}

TEST(Resampler, TonesKeepTheirTimeAndLevel) {
  for (const auto& [from, to] :
       {std::pair(44100.0, 48000.0), {48000.0, 44100.0}, {8000.0, 192000.0}, {96000.0, 8000.0}, {48000.0, 48000.0}}) {
    for (const double share : {0.0, 0.01, 0.2, 0.39}) {
      const double freq_hz = share * std::min(from, to);
      const auto sound = resample(from, to, freq_hz, {4000});
      const std::size_t begin = 40.0 * std::max(1.0, to / from);  // it begins with a step
      for (std::size_t n = begin; n < sound.size(); ++n)
        ASSERT_NEAR(sound[n], std::cos(2.0 * std::numbers::pi * freq_hz * static_cast<double>(n) / to), 1.5e-3)
            << from << " " << to << " " << freq_hz << " " << n;
    }
  }
}

TEST(Resampler, WhatTheLowerRateCannotHoldIsGone) {
  const auto sound = resample(96000.0, 32000.0, 20000.0, {2000});
  for (std::size_t n = 100; n < sound.size(); ++n) ASSERT_NEAR(sound[n], 0.0, 1e-4) << n;
}

TEST(Resampler, CallsOfAnySizeGiveTheSameBits) {
  EXPECT_EQ(resample(44100.0, 48000.0, 440.0, {1000}), resample(44100.0, 48000.0, 440.0, {1, 0, 13, 500, 486}));
}

}  // namespace
}  // namespace carillon::recording

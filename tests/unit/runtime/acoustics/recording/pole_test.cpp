// One-pole filter against its response to a tone in closed form.
#include "runtime/acoustics/recording/pole.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

namespace carillon::recording {
namespace {

TEST(Pole, AnswersATone) {
  using Complex = std::complex<double>;
  for (const double radius_m : {0.002, 0.02, 0.3})
    for (const double freq_hz : {0.0, 50.0, 1000.0, 10000.0, 19200.0}) {
      const Pole pole = make_pole(radius_m, 48000.0, 343.0);
      const double omega = 2.0 * std::numbers::pi * freq_hz, turn = omega / 48000.0;
      // z P = keep P + the sum of weight[j] z^{j - 15}, of g = 1.
      Complex sum = 0.0;
      for (int j = 0; j < kPoleTaps; ++j) sum += pole.weight[j] * std::polar(1.0, turn * (j - 15));
      const Complex found = sum / (std::polar(1.0, turn) - pole.keep), wanted = 1.0 / Complex(343.0 / radius_m, omega);
      EXPECT_LT(std::abs(found / wanted - 1.0), 2e-3) << radius_m << " m, " << freq_hz << " Hz";
    }
}

}  // namespace
}  // namespace carillon::recording

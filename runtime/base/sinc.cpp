// Method: convolution of 32 samples with a tabulated Kaiser-windowed sinc.
// Source: Kaiser 1974 (window); Abramowitz and Stegun 9.6.12 (I0, power series).
#include "runtime/base/sinc.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace carillon::base {
namespace {

constexpr double kKaiserBeta = 9.0;  // stop band -90 dB

/// Modified Bessel function I0 by its power series (Abramowitz and Stegun 9.6.12), 0 <= x <= kKaiserBeta; std::cyl_bessel_i is missing in
/// some C++ libraries.
double calc_bessel_i0(double x) {
  double term = 1.0, sum = 1.0;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= 0.25 * x * x / (static_cast<double>(k) * k);
    sum += term;
  }
  return sum;
}

/// Kaiser-windowed sin(pi x) / (pi x), -half <= x <= half, scaled by I0(kKaiserBeta). Kaiser 1974.
double calc_kaiser_sinc(double x, double half) {
  const double sinc = x == 0.0 ? 1.0 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
  const double within = std::max(0.0, 1.0 - (x / half) * (x / half));
  return sinc * calc_bessel_i0(kKaiserBeta * std::sqrt(within));
}

double calc_value(double x) { return calc_kaiser_sinc(x, kSincHalf) / calc_bessel_i0(kKaiserBeta); }

}  // namespace

const Sinc& Sinc::get() {
  static const Sinc sinc;
  return sinc;
}

Sinc::Sinc() {
  for (int i = 0; i < kSincHalf * kSincPhases; ++i) value_[i] = calc_value(static_cast<double>(i) / kSincPhases);
  for (std::size_t phase = 0; phase <= kSincPhases; ++phase) {
    std::array<double, kSincTaps> taps{};
    double total = 0.0;
    for (std::size_t j = 0; j < kSincTaps; ++j) {
      taps[j] = calc_kaiser_sinc(static_cast<double>(j) - kSincHalf + 1.0 - static_cast<double>(phase) / kSincPhases, kSincHalf);
      total += taps[j];
    }
    for (std::size_t j = 0; j < kSincTaps; ++j) delays_[phase][j] = static_cast<float>(taps[j] / total);
  }
}

double Sinc::evaluate(double x) const noexcept {
  const double place = std::abs(x) * kSincPhases;
  if (!(place < kSincHalf * kSincPhases)) return 0.0;
  const auto at = static_cast<std::size_t>(place);
  return value_[at] + (place - static_cast<double>(at)) * (value_[at + 1] - value_[at]);
}

void Sinc::make_delay(double fraction, std::array<float, kSincTaps>& taps) const noexcept {
  const double place = std::clamp(fraction, 0.0, 1.0) * kSincPhases;
  const std::size_t phase = std::min<std::size_t>(static_cast<std::size_t>(place), kSincPhases - 1);
  const auto mix = static_cast<float>(place - static_cast<double>(phase));
  const auto& before = delays_[phase];
  const auto& after = delays_[phase + 1];
  for (std::size_t j = 0; j < kSincTaps; ++j) taps[j] = before[j] + mix * (after[j] - before[j]);
}

}  // namespace carillon::base

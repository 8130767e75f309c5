// Method:     the value between samples is the sum of 32 samples under a sinc and a Kaiser window, from tables.
// Source:     Kaiser 1974 (window); Abramowitz and Stegun 9.6.12 (I0, its power series).
// Deviations: none.
#include "runtime/head/sinc.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/kaiser_sinc.hpp"

namespace carillon::head {
namespace {

double calc_value(double x) { return base::calc_kaiser_sinc(x, kSincHalf) / base::calc_bessel_i0(base::kKaiserBeta); }

}  // namespace

const Sinc& Sinc::get() {
  static const Sinc sinc;
  return sinc;
}

Sinc::Sinc() {
  for (int i = 0; i < kSincHalf * kSincPhases; ++i) value_[static_cast<std::size_t>(i)] = calc_value(static_cast<double>(i) / kSincPhases);
  for (std::size_t phase = 0; phase <= kSincPhases; ++phase) {
    std::array<double, kSincTaps> taps{};
    double total = 0.0;
    for (std::size_t j = 0; j < kSincTaps; ++j) {
      taps[j] = calc_value(kSincHalf - 1.0 + static_cast<double>(phase) / kSincPhases - static_cast<double>(j));
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
  const std::size_t phase = std::min(static_cast<std::size_t>(place), static_cast<std::size_t>(kSincPhases - 1));
  const auto mix = static_cast<float>(place - static_cast<double>(phase));
  const auto& before = delays_[phase];
  const auto& after = delays_[phase + 1];
  for (std::size_t j = 0; j < kSincTaps; ++j) taps[j] = before[j] + mix * (after[j] - before[j]);
}

}  // namespace carillon::head

// Method: an arrival is spread over 8 half-samples by a spline of degree 7, in integer units of 2^-46 Pa; images of 20 kHz are at -93 dB
//   (OCE01's Gaussian of two samples loses 2 to 9 dB at 10 kHz). Finally a filter from half-samples to samples gives the combined response
//   of runtime/base/sinc.hpp.
// Source: OCE01 section 3.3 and figure 4; Schoenberg 1946 (spline); docs/equations.md E14.
#include "precompute/simulation/emission/receivers.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "runtime/base/error.hpp"
#include "runtime/base/sinc.hpp"

namespace carillon::emission {
namespace {

constexpr int kFilterHalfSamples = 40;  // half-samples on either side in the filter

struct alignas(64) Spline {
  double factor[kSplinePoints][kSplinePoints]{};  // coefficient of a power of the offset from a half-sample, at half-sample j - 3
};

Spline make_spline() {
  // piece[p]: a polynomial on [p, p + 1], by the recursion of Cox and de Boor.
  std::array<std::array<double, kSplinePoints + 1>, kSplinePoints> piece{};
  piece[0][0] = 1.0;
  for (int order = 1; order < kSplinePoints; ++order)
    for (int p = order; p >= 0; --p) {
      std::array<double, kSplinePoints + 1> next{};
      for (std::size_t d = 0; d < kSplinePoints; ++d) {
        const double own = piece[p][d], before = p > 0 ? piece[p - 1][d] : 0.0;
        next[d] += (p * own + (order + 1 - p) * before) / order;
        next[d + 1] += (own - before) / order;
      }
      piece[p] = next;
    }
  Spline spline;
  for (std::size_t d = 0; d < kSplinePoints; ++d)
    for (std::size_t j = 0; j < kSplinePoints; ++j) spline.factor[d][j] = piece[kSplinePoints - 1 - j][d];
  return spline;
}

/// Weights of the half-samples 0 to kFilterHalfSamples on either side of a sample.
std::array<double, kFilterHalfSamples + 1> make_filter() {
  constexpr int kPoints = 128, kParts = 4;  // frequencies up to the sample rate; sinc values per sample
  const base::Sinc& sinc = base::Sinc::get();
  std::array<double, kFilterHalfSamples + 1> filter{};
  for (int i = 0; i < kPoints; ++i) {
    const double turn = std::numbers::pi * (i + 0.5) / kPoints;  // per half-sample
    double response = sinc.evaluate(0.0);
    for (int n = 1; n < base::kSincHalf * kParts; ++n)
      response += 2.0 * sinc.evaluate(static_cast<double>(n) / kParts) * std::cos(2.0 / kParts * turn * n);
    response /= std::pow(std::sin(0.5 * turn) / (0.5 * turn), kSplinePoints);
    for (int j = 0; j <= kFilterHalfSamples; ++j) filter[j] += response * std::cos(turn * j);
  }
  double total = filter[0];
  for (std::size_t j = 1; j <= kFilterHalfSamples; ++j) total += 2.0 * filter[j];
  for (double& one : filter) one *= 2.0 / total;  // only one of the two half-samples per sample carries the pressure
  return filter;
}

}  // namespace

std::vector<Microphone> make_ears(const Vec3& position_m, const Vec3& look_at_m, double distance_m) {
  const Vec3 view = look_at_m - position_m, right{view[1], -view[0], 0.0};
  if (!(norm(right) > 1e-6 * norm(view)) || !(norm(view) > 0.0))
    throw InputError("the listener looks straight up or down, or nowhere, so its ears have no place; move look_at_m to its side");
  const Vec3 half = (0.5 * distance_m) * normalise(right);
  Microphone left, other;
  left.place_m = position_m - half;
  other.place_m = position_m + half;
  return {left, other};
}

Arrivals::Arrivals(std::size_t frames)
    : loops_(&find_loops()), frames_(frames), units_(2 * (frames + kFilterHalfSamples + kSplinePoints), 0) {}

bool Arrivals::add(std::int64_t sample, std::span<const double> time, const double* pressure_pa) {
  static const Spline spline = make_spline();
  return loops_->scatter(units_.data() + kFilterHalfSamples - (kSplinePoints / 2 - 1), 2.0 * static_cast<double>(sample),
                         2.0 * static_cast<double>(frames_) + kFilterHalfSamples, time.data(), pressure_pa, time.size(), spline.factor[0]);
}

std::vector<double> Arrivals::sum(const comm::Communicator& comm) const {
  static const std::array<double, kFilterHalfSamples + 1> filter = make_filter();
  std::vector<std::int64_t> all(units_);
  comm.sum(std::span<std::int64_t>(all));
  std::vector<double> pressure(frames_);
  for (std::size_t n = 0; n < frames_; ++n) {
    const std::int64_t* now = all.data() + kFilterHalfSamples + 2 * n;
    double sum = filter[0] * static_cast<double>(now[0]);
    for (int j = 1; j <= kFilterHalfSamples; ++j) sum += filter[j] * (static_cast<double>(now[j]) + static_cast<double>(now[-j]));
    pressure[n] = sum / kUnitsPerPa;
  }
  return pressure;
}

}  // namespace carillon::emission

// Method:     the k-th lowest of numbers in intervals lies between the k-th lowest of all lower and of all upper ends. Unlisted modes take
//   part: one above the list, computed at F or higher, has a true value of at least F 2^(-b/1200), b being the bar of a mode there; one
//   below, computed at F or lower, at most F 2^(b/1200).
// Deviations: b is an estimate. Bars of different kinds of modes (bending, stretching) differ a hundredfold and are far apart in frequency,
//   so b is the widest bar within kAboutOctave of the end of the list, extrapolated if bars grow from octave to octave. F is the worst case
//   as long as b < 1731 cents times the growth exponent; wider bars are useless anyway.
#include "precompute/fem/error_bars/order.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/base/sort_order.hpp"

namespace carillon::error_bars {
namespace {

constexpr double kOctave = 1200.0;       // cents
constexpr double kAboutOctave = 1250.0;  // a little more: the second mode of a kind (torsion) may be an octave above the first

/// Bar of a mode at `top`, at or above the last. at: positions of the modes [cents], ascending.
double predict(std::span<const double> at, std::span<const double> cents, double top) {
  const std::size_t count = at.size();
  const std::size_t octave = std::upper_bound(at.begin(), at.end(), top - kAboutOctave) - at.begin();
  const std::size_t first = std::min(octave, count - (count + 3) / 4);  // at least a quarter of the list
  const auto begin = cents.begin();
  const auto near = std::max_element(begin + static_cast<std::ptrdiff_t>(first), cents.end());
  // Bars grow at most with the frequency, as for bending. A list within one octave determines no growth.
  double power = 1.0;
  if (octave > 0) {
    const auto far = std::max_element(begin, begin + static_cast<std::ptrdiff_t>(octave));
    const double apart = (at[near - begin] - at[far - begin]) / kOctave;
    power = *near > *far && apart > 0 ? std::min(1.0, std::log2(*near / *far) / apart) : 0.0;
  }
  double widest = 0.0;
  for (std::size_t m = first; m < count; ++m)
    widest = std::max(widest, cents[m] * std::exp2(power * std::min(1.0, (top - at[m]) / kOctave)));
  return widest;
}

}  // namespace

double find_lowest_unlisted(std::span<const double> lambda, std::span<const double> moved, const Unlisted& unlisted) {
  std::vector<double> at, reach;
  for (std::size_t m = 0; m < lambda.size(); ++m) {
    at.push_back(600 * std::log2(lambda[m] / lambda[0]));
    reach.push_back(std::max(-moved[m], 0.0));
  }
  const double high = 4 * std::numbers::pi * std::numbers::pi * unlisted.high_hz * unlisted.high_hz;
  const double top = high > 0 ? std::max(at.back(), 600 * std::log2(high / lambda[0])) : at.back();
  return lambda[0] * std::exp2((top - predict(at, reach, top)) / 600);
}

double find_highest_unlisted(std::span<const double> lambda, std::span<const double> moved, const Unlisted& unlisted) {
  if (unlisted.below <= 0 || unlisted.low_hz <= 0) return 0.0;
  const double bottom = std::min(lambda[0], 4 * std::numbers::pi * std::numbers::pi * unlisted.low_hz * unlisted.low_hz);
  const auto octave = std::ranges::upper_bound(lambda, bottom * std::exp2(kAboutOctave / 600)) - lambda.begin();
  const auto last = std::max(octave, static_cast<std::ptrdiff_t>((lambda.size() + 3) / 4));
  return bottom * std::exp2(std::max(*std::max_element(moved.begin(), moved.begin() + last), 0.0) / 600);
}

std::vector<double> widen_for_order(std::span<const double> lambda, const OwnIntervals& own, const Unlisted& unlisted) {
  const std::size_t count = lambda.size();
  const auto place = [&](double l) { return 600 * std::log2(l / lambda[0]); };
  std::vector<double> at(count), stated(count), low(count), high(count), result(count);
  for (std::size_t m = 0; m < count; ++m) {
    at[m] = place(lambda[m]);
    stated[m] = at[m] + own.stated[m];
    low[m] = at[m] + own.low[m];
    high[m] = at[m] + own.high[m];
  }
  const std::vector<std::size_t> order = base::find_sort_order(stated);
  std::sort(low.begin(), low.end());
  std::sort(high.begin(), high.end());
  const double min = place(find_lowest_unlisted(lambda, own.low, unlisted));  // lower bound of all modes above
  const double below = find_highest_unlisted(lambda, own.above, unlisted);
  const double max = below > 0 ? place(below) : at[0] - 1e9;  // upper bound of all modes below
  for (std::size_t k = 0; k < count; ++k)
    result[order[k]] = std::max(stated[order[k]] - std::min(low[k], min), std::max(high[k], max) - stated[order[k]]);
  return result;
}

}  // namespace carillon::error_bars

// Method:     Regula falsi on the count of eigenvalues as a function of frequency, in which the modes of a body lie about evenly.
// Source:     Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994, section 4.
// Deviations: all cuts are made before the first slice is solved.
#include "precompute/eigen/slices.hpp"

#include <algorithm>
#include <cmath>

namespace carillon::eigen {
namespace {

// Between both ends, `part` of the way in frequency.
double calc_cut(double low, double high, double part) {
  const double root = std::lerp(std::sqrt(low), std::sqrt(high), part);
  return root * root;
}

}  // namespace

Slice cut_to_lowest(const Slice& band, std::int64_t wanted, const CountBelow& count_below) {
  if (wanted >= band.count()) return band;
  constexpr int kTrials = 8;
  const std::int64_t enough = wanted + std::max<std::int64_t>(10, wanted / 16);
  Slice cut = band;
  double too_low = band.low;
  std::int64_t below_too_low = band.below_low;
  for (int i = 0; i < kTrials && cut.count() > enough; ++i) {
    const auto goal = static_cast<double>(band.below_low + (wanted + enough) / 2 - below_too_low);
    const double part = std::clamp(goal / static_cast<double>(cut.below_high - below_too_low), 0.05, 0.95);
    const double trial = calc_cut(too_low, cut.high, part);
    const std::int64_t below = count_below(trial);
    if (below - band.below_low >= wanted) {
      cut.high = trial;
      cut.below_high = below;
    } else {
      too_low = trial;
      below_too_low = below;
    }
  }
  return cut;
}

std::vector<Slice> cut_into_slices(const Slice& band, std::int64_t most, const CountBelow& count_below) {
  constexpr double kNarrow = 1e-4;
  if (band.count() <= most || band.high - band.low < kNarrow * band.high) return {band};
  const auto parts = static_cast<double>((band.count() + most - 1) / most);
  Slice left = band;
  left.high = calc_cut(band.low, band.high, std::floor(parts / 2) / parts);
  left.below_high = count_below(left.high);
  Slice right = band;
  right.low = left.high;
  right.below_low = left.below_high;
  std::vector<Slice> slices = cut_into_slices(left, most, count_below);
  for (const Slice& slice : cut_into_slices(right, most, count_below)) slices.push_back(slice);
  return slices;
}

}  // namespace carillon::eigen

// Method:     The count of eigenvalues grows about as a power of frequency. Between two counts that were taken it is interpolated in
//             logarithms; below the first one that counts anything, the power of the next interval, or the usual one, is taken.
// Source:     Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994, section 4 (cuts by counts).
//             Courant, Hilbert, Methods of mathematical physics I, 1953, section VI.4: powers of 1 (bending plates) to 3 (solids).
// Deviations: all cuts are made before the first slice is solved.
#include "precompute/eigen/slices.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace carillon::eigen {
namespace {

constexpr double kUsualPower = 0.8;      // of lambda, where nothing better is known: between plates and solids
constexpr double kNearEnd = 0.05;        // A cut stays this far from the ends of the interval it falls into, as a part of it in frequency;
constexpr double kTowardsMiddle = 0.25;  // this far, where counts turned out unlike a power.

// Counts by lambda, those of the band's ends and those taken since, relative to the lower end.
class Counts {
 public:
  explicit Counts(const Slice& band) : below_low_(band.below_low) { known_ = {{band.low, 0}, {band.high, band.count()}}; }

  double find_above(std::int64_t below) const { return static_cast<double>(below - below_low_); }
  void add(double lambda, std::int64_t below) { known_[lambda] = below - below_low_; }

  // Where about `wanted` eigenvalues lie above the lower end; within the interval of known counts around it, `margin` of it (in frequency)
  // from either end.
  double find_lambda(double wanted, double margin) const {
    auto high =
        std::find_if(std::next(known_.begin()), known_.end(), [&](const auto& k) { return static_cast<double>(k.second) >= wanted; });
    if (high == known_.end()) --high;
    const auto low = std::prev(high);
    double power = kUsualPower;
    if (low->second > 0) {
      power = calc_power(*low, *high);
    } else if (std::next(high) != known_.end()) {
      power = calc_power(*high, *std::next(high));
    }
    const double guess = high->first * std::pow(wanted / static_cast<double>(high->second), 1 / power);
    const double root_low = std::sqrt(low->first);
    const double root_high = std::sqrt(high->first);
    const double root = std::clamp(std::sqrt(guess), std::lerp(root_low, root_high, margin), std::lerp(root_high, root_low, margin));
    return root * root;
  }

 private:
  using Known = std::pair<const double, std::int64_t>;
  static double calc_power(const Known& a, const Known& b) {
    const double power = std::log(static_cast<double>(b.second) / static_cast<double>(a.second)) / std::log(b.first / a.first);
    return std::clamp(power, 0.1, 10.0);
  }

  std::int64_t below_low_;
  std::map<double, std::int64_t> known_;
};

void cut_further(const Slice& whole, std::int64_t most, double margin, Counts& counts, const CountBelow& count_below,
                 std::vector<Slice>& result) {
  constexpr double kNarrow = 1e-4;
  constexpr double kFilled = 0.9;  // Cuts are not exact.
  if (whole.count() <= most || whole.high - whole.low < kNarrow * whole.high) {
    result.push_back(whole);
    return;
  }
  const auto parts = std::max(2, static_cast<int>(std::ceil(static_cast<double>(whole.count()) / (kFilled * static_cast<double>(most)))));
  std::vector<Slice> slices;
  Slice rest = whole;
  for (int i = 1; i < parts; ++i) {
    const double cut = counts.find_lambda(counts.find_above(whole.below_low) + static_cast<double>(whole.count()) * i / parts, margin);
    if (cut <= rest.low || cut >= rest.high) continue;
    const std::int64_t below = count_below(cut);
    counts.add(cut, below);
    slices.push_back({rest.low, rest.below_low, cut, below});
    rest.low = cut;
    rest.below_low = below;
  }
  slices.push_back(rest);
  for (const Slice& slice : slices) cut_further(slice, most, kTowardsMiddle, counts, count_below, result);
}

}  // namespace

Slice cut_to_lowest(const Slice& band, std::int64_t wanted, const CountBelow& count_below) {
  if (wanted >= band.count()) return band;
  constexpr int kTrials = 8;
  const std::int64_t enough = wanted + std::max<std::int64_t>(10, wanted / 16);
  Slice cut = band;
  Counts counts(band);
  for (int i = 0; i < kTrials && cut.count() > enough; ++i) {
    const double trial = counts.find_lambda(0.5 * static_cast<double>(wanted + enough), kNearEnd);
    const std::int64_t below = count_below(trial);
    counts.add(trial, below);
    if (below - band.below_low < wanted) continue;
    cut.high = trial;
    cut.below_high = below;
  }
  return cut;
}

std::vector<Slice> cut_into_slices(const Slice& band, std::int64_t most, const CountBelow& count_below) {
  Counts counts(band);
  std::vector<Slice> slices;
  cut_further(band, most, kNearEnd, counts, count_below, slices);
  return slices;
}

}  // namespace carillon::eigen

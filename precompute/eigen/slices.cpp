// Method:     The count of eigenvalues grows about as a power of frequency. Between two counts that were taken it is interpolated in
//             logarithms; below the first one that counts anything, the power of the next interval, or the usual one, is taken.
// Source:     Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994, section 4 (shifts by
//             counts). Courant, Hilbert, Methods of mathematical physics I, 1953, section VI.4: powers of 1 (bending plates) to 3 (solids).
// Deviations: a slice ends where it was predicted to, not where its pairs stop to converge.
#include "precompute/eigen/slices.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace carillon::eigen {
namespace {

constexpr double kDefaultPower = 0.8;  // of lambda, where nothing better is known: between plates and solids
constexpr double kNearEnd = 0.05;      // A guess stays this far from the ends of the interval it falls into, as a part of it in frequency.
constexpr double kNarrow = 1e-4;       // of lambda: the width of what is not cut
constexpr double kLopsided = 2;        // A shift is at most this much nearer to one end of its slice than to the other.

double calc_power(const std::pair<const double, std::int64_t>& a, const std::pair<const double, std::int64_t>& b) {
  const double power = std::log(static_cast<double>(b.second) / static_cast<double>(a.second)) / std::log(b.first / a.first);
  return std::clamp(power, 0.1, 10.0);
}

}  // namespace

Counts::Counts(const Slice& band) : below_low_(band.below_low), known_{{band.low, 0}, {band.high, band.count()}} {}

void Counts::add(double lambda, std::int64_t below) { known_[lambda] = below - below_low_; }

double Counts::find_lambda(double below, double margin) const {
  const double wanted = below - static_cast<double>(below_low_);
  auto high = std::find_if(std::next(known_.begin()), known_.end(), [&](const auto& k) { return static_cast<double>(k.second) >= wanted; });
  if (high == known_.end()) --high;
  const auto low = std::prev(high);
  double power = kDefaultPower;
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

Slice cut_to_lowest(const Slice& band, std::int64_t wanted, const CountBelow& count_below) {
  if (wanted >= band.count()) return band;
  constexpr int kTrials = 8;
  const std::int64_t enough = wanted + std::max<std::int64_t>(10, wanted / 16);
  Slice cut = band;
  Counts counts(band);
  for (int i = 0; i < kTrials && cut.count() > enough; ++i) {
    const double trial = counts.find_lambda(static_cast<double>(band.below_low) + 0.5 * static_cast<double>(wanted + enough), kNearEnd);
    const std::int64_t below = count_below(trial);
    counts.add(trial, below);
    if (below - band.below_low < wanted) continue;
    cut.high = trial;
    cut.below_high = below;
  }
  return cut;
}

Sweep::Sweep(const Slice& band, std::int64_t max, CountBelow count_below)
    : rest_(band), max_(max), count_below_(std::move(count_below)), counts_(band) {}

bool Sweep::is_last() const { return rest_.count() <= max_ || rest_.high - rest_.low < kNarrow * rest_.high; }

Sweep::Part Sweep::take() {
  constexpr int kTrials = 3;  // by what the counts predict, then by halves
  const double parts = std::ceil(static_cast<double>(rest_.count()) / static_cast<double>(max_));
  const double share = static_cast<double>(rest_.count()) / parts;
  const auto below_low = static_cast<double>(rest_.below_low);
  Part part{rest_.low, rest_.below_low, rest_};
  double few = rest_.low;    // too few of the slice's eigenvalues lie below it,
  double many = rest_.high;  // and too many below this
  double under = 0;          // the shift
  bool is_cluster = false;
  for (int trial = 0;; ++trial) {
    const double predicted = std::midpoint(rest_.low, counts_.find_lambda(below_low + share, kNearEnd));
    part.sigma = is_cluster ? many : std::midpoint(few, many);
    if (trial < kTrials && !is_cluster) part.sigma = std::clamp(predicted, std::lerp(few, many, kNearEnd), std::lerp(many, few, kNearEnd));
    const std::int64_t below = count_below_(part.sigma);
    counts_.add(part.sigma, below);
    part.below_sigma = below;
    under = static_cast<double>(below) - below_low;
    if (is_cluster || (under >= 0.2 * share && under <= static_cast<double>(max_))) break;
    (under < share ? few : many) = part.sigma;
    is_cluster = many - few < kNarrow * many;
    if (is_cluster && (part.sigma == many || many == rest_.high)) break;  // Else once more, above it: all of it is below the shift then.
  }
  const double reach = part.sigma - rest_.low;
  const double wanted = std::max(share, 1.25 * under);
  const double predicted = counts_.find_lambda(below_low + wanted, 0);
  part.slice.high = is_cluster ? std::max(predicted, many * (1 + kNarrow))
                               : std::clamp(predicted, part.sigma + reach / kLopsided, part.sigma + reach * kLopsided);
  part.slice.high = std::min(part.slice.high, rest_.high);
  part.slice.below_high = rest_.below_low + static_cast<std::int64_t>(wanted);
  return part;
}

void Sweep::advance(double lambda, std::int64_t below) {
  rest_.low = lambda;
  rest_.below_low = below;
}

}  // namespace carillon::eigen

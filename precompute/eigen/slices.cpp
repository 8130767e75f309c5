// Method: The eigenvalue count grows about as a power of frequency. Between two known counts it is interpolated logarithmically; below the
// first nonzero count, the power of the next interval or a default is used. A slice ends where predicted, not where its pairs stop
// converging.
// Source: Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994, section 4 (shifts by counts).
// Courant, Hilbert, Methods of mathematical physics I, 1953, section VI.4: powers of 1 (bending plates) to 3 (solids).
#include "precompute/eigen/slices.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace carillon::eigen {
namespace {

constexpr double kDefaultPower = 0.8;  // of lambda, without known counts: between plates and solids
constexpr double kNearEnd = 0.05;  // Minimum distance of a guess from the ends of its interval, as a fraction of the interval in frequency.
constexpr double kNarrow = 1e-4;   // relative to lambda: slices narrower than this are not cut
constexpr double kLopsided = 2;    // Maximum ratio of the distances from a shift to the ends of its slice.

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

Slice cut_to_lowest(const Slice& band, std::int64_t wanted, double expected, const CountBelow& count_below) {
  if (wanted >= band.count()) return band;
  constexpr int kTrials = 8;
  const std::int64_t enough = wanted + std::max<std::int64_t>(10, wanted / 16);
  Slice cut = band;
  Counts counts(band), guessed(band);
  const bool is_guessed = expected > band.low && expected < band.high;
  if (is_guessed) guessed.add(expected, band.below_low + wanted);
  for (int i = 0; i < kTrials && cut.count() > enough; ++i) {
    const double middle = static_cast<double>(band.below_low) + 0.5 * static_cast<double>(wanted + enough);
    const double trial = i == 0 && is_guessed ? guessed.find_lambda(middle, 0.0) : counts.find_lambda(middle, kNearEnd);
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
  constexpr int kTrials = 3;  // by prediction, then by bisection
  const double parts = std::ceil(static_cast<double>(rest_.count()) / static_cast<double>(max_));
  const double share = static_cast<double>(rest_.count()) / parts;
  const auto below_low = static_cast<double>(rest_.below_low);
  Part part{rest_.low, rest_.below_low, rest_};
  double few = rest_.low;    // lower bound of the shift: too few eigenvalues below it
  double many = rest_.high;  // upper bound of the shift: too many eigenvalues below it
  double under = 0;          // eigenvalues between the start of the slice and the shift
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
    if (is_cluster && (part.sigma == many || many == rest_.high))
      break;  // Otherwise count once more above the cluster, so that all of it is below the shift.
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

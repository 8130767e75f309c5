// Method: Between two counts, the number of modes must equal their difference. A count on a mode includes it or not, depending on rounding.
// Source: Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994, section 4.
#include "precompute/eigen/proof.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "runtime/base/error.hpp"
#include "runtime/base/sort_order.hpp"

namespace carillon::eigen {
namespace {

constexpr double kSeparated = 1e-6;  // Modes farther apart than this, relative to lambda, are not degenerate.

}  // namespace

std::vector<Inertia> sort_counts(std::vector<Inertia> counts) {
  std::sort(counts.begin(), counts.end(), [](const Inertia& a, const Inertia& b) { return a.lambda < b.lambda; });
  return counts;
}

std::int64_t count_found(const std::vector<double>& lambda, double low, double high) {
  return std::count_if(lambda.begin(), lambda.end(), [&](double x) { return x >= low && x < high; });
}

double find_margin(const std::vector<double>& lambda, double at) {
  double margin = std::numeric_limits<double>::infinity();
  for (const double found : lambda) margin = std::min(margin, std::abs(found - at) / at);
  return margin;
}

std::optional<double> find_safer_shift(const std::vector<double>& lambda, double shift, const BandLimits& limits) {
  if (find_margin(lambda, shift) >= kSafeMargin) return std::nullopt;
  if (shift >= limits.high) return shift * (1 + 10 * kSafeMargin);
  if (shift <= limits.low) return shift * (1 - 10 * kSafeMargin);
  std::vector<double> sorted = lambda;
  std::sort(sorted.begin(), sorted.end());
  double best = 0;
  std::optional<double> place;
  for (std::size_t j = 1; j < sorted.size(); ++j) {
    const double middle = std::midpoint(sorted[j - 1], sorted[j]);
    const double gap = sorted[j] - sorted[j - 1];
    const double distance = std::abs(middle - shift);
    if (gap / (gap + distance) > best) {
      best = gap / (gap + distance);
      place = middle;
    }
  }
  return place;
}

double find_mode_outside(const std::vector<double>& lambda, double count, const BandLimits& limits, bool is_high) {
  double nearest = count;
  for (const double x : lambda) {
    if (is_high && limits.is_above(x)) nearest = std::min(nearest, x);
    if (!is_high && limits.is_below(x)) nearest = std::max(nearest, x);
  }
  return nearest;
}

double find_end_of_search(const std::vector<double>& lambda, std::optional<std::int64_t> max_modes, double searched_to) {
  if (!max_modes || static_cast<std::int64_t>(lambda.size()) < *max_modes) return searched_to;
  std::vector<double> sorted = lambda;
  const auto last = sorted.begin() + (*max_modes - 1);
  std::nth_element(sorted.begin(), last, sorted.end());
  return *last;
}

void verify(const std::vector<Inertia>& counts, const std::vector<double>& lambda, double end, const std::function<double(double)>& to_hz) {
  const std::vector<Inertia> sorted = sort_counts(counts);
  for (std::size_t i = 1; i < sorted.size() && sorted[i - 1].lambda < end; ++i) {
    const std::int64_t counted = sorted[i].below - sorted[i - 1].below;
    const std::int64_t found = count_found(lambda, sorted[i - 1].lambda, sorted[i].lambda);
    if (found == counted) continue;
    throw SolveError(
        fmt::format("Between {:.6g} and {:.6g} Hz the inertia of K - lambda M counts {} modes, and {} were found. Take a tighter "
                    "tolerance, solve the band in parts, or let MUMPS factorise.",
                    to_hz(sorted[i - 1].lambda), to_hz(sorted[i].lambda), counted, found));
  }
}

WantedModes select_wanted(const std::vector<double>& lambda, const BandLimits& limits, std::optional<std::int64_t> max_modes) {
  WantedModes wanted;
  std::vector<std::size_t>& order = wanted.order;
  order = base::find_sort_order(lambda);
  std::erase_if(order, [&](std::size_t i) { return limits.is_below(lambda[i]) || limits.is_above(lambda[i]); });
  wanted.within = static_cast<std::int64_t>(order.size());
  // Degenerate modes are all kept until their basis is made: part of a cluster would depend on the iteration.
  if (max_modes && wanted.within > *max_modes) {
    auto kept = static_cast<std::size_t>(*max_modes);
    while (kept < order.size() && lambda[order[kept]] <= lambda[order[kept - 1]] * (1 + kSeparated)) ++kept;
    order.resize(kept);
  }
  std::vector<char> is_taken(lambda.size(), 0);
  for (const std::size_t i : order) is_taken[i] = 1;
  for (std::size_t i = 0; i < lambda.size(); ++i)
    if (is_taken[i] == 0) wanted.others.push_back(lambda[i]);
  return wanted;
}

}  // namespace carillon::eigen

// Counts of eigenvalues against modes found.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "precompute/eigen/band.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

inline constexpr double kSafeMargin = 1e-7;  // Counts nearer to a mode (relative to lambda) are taken again, farther from it.

std::vector<Inertia> sort_counts(std::vector<Inertia> counts);

/// Modes with low <= lambda < high; lambda in any order.
std::int64_t count_found(const std::vector<double>& lambda, double low, double high);

/// Distance of the nearest mode, relative to `at`; infinite without modes.
double find_margin(const std::vector<double>& lambda, double at);

/// A shift that came to lie on a mode, where its count is worth nothing: where to count instead. An end of the band moves outwards, a shift
/// within it to the middle of the widest gap nearby. Empty where the count is safe, or there is no gap.
std::optional<double> find_safer_shift(const std::vector<double>& lambda, double shift, const BandLimits& limits);

/// Of a mode that lies between an end of the band and its count: the nearest to the band. `count` itself where there is none.
double find_mode_outside(const std::vector<double>& lambda, double count, const BandLimits& limits, bool is_high);

/// Where the search ended: beyond max_modes nothing is asked for.
double find_end_of_search(const std::vector<double>& lambda, std::optional<std::int64_t> max_modes, double searched_to);

/// Throws SolveError unless as many modes lie between any two neighbouring counts up to `end` as these differ by. to_hz: of a scaled
/// lambda, for the message.
void verify(const std::vector<Inertia>& counts, const std::vector<double>& lambda, double end, const std::function<double(double)>& to_hz);

/// What of the modes found is in the band and wanted.
struct WantedModes {
  std::vector<std::size_t> order;  // their places, ascending in lambda; with max_modes all that are degenerate with the last
  std::vector<double> others;      // lambda of the rest
  std::int64_t within = 0;         // modes found in the band
};
WantedModes select_wanted(const std::vector<double>& lambda, const BandLimits& limits, std::optional<std::int64_t> max_modes);

}  // namespace carillon::eigen

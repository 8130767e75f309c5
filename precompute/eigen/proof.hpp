// Comparison of eigenvalue counts with the modes found.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "precompute/eigen/band.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

inline constexpr double kSafeMargin = 1e-7;  // Counts closer to a mode (relative to lambda) are repeated farther away.

std::vector<Inertia> sort_counts(std::vector<Inertia> counts);

/// Modes with low <= lambda < high; lambda in any order.
std::int64_t count_found(const std::vector<double>& lambda, double low, double high);

/// Distance to the nearest mode, relative to `at`; infinite without modes.
double find_margin(const std::vector<double>& lambda, double at);

/// Replacement for a shift on a mode, whose count is unreliable: an end of the band moves outwards, an inner shift to the middle of the
/// widest gap nearby. Empty if the count is safe, or there is no gap.
std::optional<double> find_safer_shift(const std::vector<double>& lambda, double shift, const BandLimits& limits);

/// Lambda of the mode between an end of the band and its count that is nearest to the band; `count` if there is none.
double find_mode_outside(const std::vector<double>& lambda, double count, const BandLimits& limits, bool is_high);

/// Upper end of the search: modes beyond max_modes are not required.
double find_end_of_search(const std::vector<double>& lambda, std::optional<std::int64_t> max_modes, double searched_to);

/// Throws SolveError unless the number of modes between neighbouring counts up to `end` equals their difference. to_hz: scaled lambda to
/// Hz, for the message.
void verify(const std::vector<Inertia>& counts, const std::vector<double>& lambda, double end, const std::function<double(double)>& to_hz);

/// Modes found in the band, cut to max_modes.
struct WantedModes {
  std::vector<std::size_t> order;  // indices, ascending in lambda; with max_modes including all modes degenerate with the last
  std::vector<double> others;      // lambda of the remaining modes
  std::int64_t within = 0;         // modes found in the band
};
WantedModes select_wanted(const std::vector<double>& lambda, const BandLimits& limits, std::optional<std::int64_t> max_modes);

}  // namespace carillon::eigen

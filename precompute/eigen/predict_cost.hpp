// Cost of a solve predicted before it begins: memory, operations, modes. The solver and --validate use the same formulas.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/slices.hpp"
#include "precompute/eigen/types.hpp"
#include "precompute/job/cost/calibration.hpp"

namespace carillon::eigen {

// docs/accuracy.md measures both: at a few hundred rows dense and sparse take the same time; for more rows sparse is much faster.
inline constexpr PetscInt kDenseRows = cost::kDenseRows;        // Smaller problems are solved densely,
inline constexpr PetscInt kDenseRowsFull = 3000;                // and up to this size if more than kDenseShare of the spectrum is wanted,
inline constexpr double kDenseShare = 0.4;                      // because the Lanczos basis then spans most of the space.
inline constexpr std::int64_t kSliceModes = cost::kSliceModes;  // For more modes, orthogonalisation costs more than another factorisation.

inline constexpr double kEdgeNudge = 1e-6;  // Counts are taken this far outside the band, relative to lambda.

/// Ends of the band as eigenvalues [(rad/s)^2]. A lower end of zero becomes the smallest value that double precision resolves against the
/// upper end.
struct BandEnds {
  double low = 0;
  double high = 0;
};
BandEnds find_ends(const Options& options);

/// True if the options allow to leave the count at the lower end to the shift inside the band. Few bodies have a mode that far below the
/// upper end, and a guess that is a few modes too high costs almost nothing. Not with max_modes, whose cut would use the guess.
bool can_assume_low_end(const Options& options);

/// InertiaCounter::count_below or a wrapper of it.
using TakeCount = std::function<Inertia(double lambda, double reach, ShiftRule rule)>;

/// Counts the eigenvalues below an end of the band (scaled), slightly outside it; the lower count may move up for rounding. One
/// factorisation each, rarely more. Collective.
Inertia count_below_low(const TakeCount& take, double low);
Inertia count_below_high(const TakeCount& take, double high);
/// Shift of the first attempt of count_below_low().
inline double find_count_below_low(double low) { return low * (1 - 2 * kEdgeNudge); }

/// Memory on this rank [byte]: K and M in node blocks at their peak during assembly, and the rigid modes.
std::int64_t calc_copies_bytes(const Problem& problem);
/// The part that stays allocated during the solve.
std::int64_t calc_kept_bytes(const Problem& problem);
/// The modes, the Lanczos basis and the locked modes, for `rows` rows of this rank.
std::int64_t calc_search_bytes(std::int64_t rows, std::int64_t modes, std::int64_t rigid_count);
/// Matrices of a dense solve. Rank 0 solves; other ranks hold copies of input and output.
std::int64_t calc_dense_bytes(std::int64_t unknowns, bool is_root);

/// Predicted cost of a solve.
struct SolveCost {
  bool is_dense = false;               // LAPACK; only copies and rigid_count are set
  std::int64_t entries = 0;            // factor entries, all ranks
  double flops = 0;                    // of one factorisation
  std::int64_t factor_bytes = 0;       // peak on this rank
  std::int64_t factor_kept_bytes = 0;  // after the factorisation
  std::int64_t copies_bytes = 0;
  std::int64_t copies_kept_bytes = 0;
  std::int64_t rigid_count = 0;
  std::optional<std::int64_t> modes;  // modes in the band, at most max_modes; empty if not counted
};

/// Analyses K - sigma M. If may_count() accepts the cost of two factorisations and memory suffices, also counts the modes of the band by
/// inertia. K and M are unchanged. Throws the errors that solve_modes() throws before its search, except for lack of memory. Collective.
SolveCost predict_cost(const Problem& problem, const Options& options, const std::function<bool(const SolveCost&)>& may_count);

}  // namespace carillon::eigen

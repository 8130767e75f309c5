// What a solve needs, known before it begins: memory, operations, modes. The solver and --validate use the same formulas.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/slices.hpp"
#include "precompute/eigen/types.hpp"
#include "precompute/job/cost/calibration.hpp"

namespace carillon::eigen {

// docs/accuracy.md measures both: at some hundred rows dense and sparse take the same time, beyond it sparse is the faster by far.
inline constexpr PetscInt kDenseRows = cost::kDenseRows;        // Smaller problems are solved densely straight away,
inline constexpr PetscInt kDenseRowsFull = 3000;                // and up to here when a larger part of the spectrum is wanted than this,
inline constexpr double kDenseShare = 0.4;                      // where Lanczos runs meet their own ends.
inline constexpr std::int64_t kSliceModes = cost::kSliceModes;  // Beyond, orthogonalisation costs more than another factorisation.

inline constexpr double kEdgeNudge = 1e-6;  // Counts are taken this far outside the band, relative to lambda.

/// The ends of the band as eigenvalues [(rad/s)^2]; a lower one of zero is what no mesh can resolve in double precision against the upper
/// one.
struct BandEnds {
  double low = 0;
  double high = 0;
};
BandEnds find_ends(const Options& options);

/// Whether the count at the lower end may be left to the shift inside the band, as far as the options say. So far below the upper end few
/// bodies have a mode, and a guess of some modes too many costs next to nothing. A part of the band alone (max_modes) would be cut by the
/// guess, and CHOLMOD counts nothing at its shift.
bool can_assume_low_end(const Options& options);

/// InertiaCounter::count_below, or who asks it.
using TakeCount = std::function<Inertia(double lambda, double reach, ShiftRule rule)>;

/// Counts the eigenvalues below an end of the band (scaled), a little outside it; below the lower one where rounding allows. A
/// factorisation each, seldom more. Collective.
Inertia count_below_low(const TakeCount& take, double low);
Inertia count_below_high(const TakeCount& take, double high);
/// Where the first of them is taken.
inline double find_count_below_low(double low) { return low * (1 - 2 * kEdgeNudge); }

/// Of this rank [byte]. K and M by nodes, at their worst moment while their arrays grow, and the rigid modes.
std::int64_t calc_copies_bytes(const Problem& problem);
/// What stays of it during the solve.
std::int64_t calc_kept_bytes(const Problem& problem);
/// The modes, the basis they are sought in, and the deflated ones, for `rows` rows of this rank and so many modes.
std::int64_t calc_search_bytes(std::int64_t rows, std::int64_t modes, std::int64_t rigid_count);
/// The matrices of a dense solve. Rank 0 solves; the others have copies of what goes in and comes out.
std::int64_t calc_dense_bytes(std::int64_t unknowns, bool is_root);

/// Of a solve that was not made.
struct SolveEstimate {
  bool is_dense = false;               // LAPACK; nothing below is known but the count
  std::int64_t entries = 0;            // of a factor, all ranks
  double flops = 0;                    // of a factorisation
  std::int64_t factor_bytes = 0;       // at its worst moment on this rank
  std::int64_t factor_kept_bytes = 0;  // when it stands
  std::int64_t copies_bytes = 0;
  std::int64_t copies_kept_bytes = 0;
  std::int64_t rigid_count = 0;
  std::optional<std::int64_t> modes;  // of the band, as many as are wanted at most; empty: not counted
};

/// Analyses K - sigma M, and counts the modes of the band by inertia if `may_count` says that two factorisations of so many flops are worth
/// it and there is memory for them. K and M are as before afterwards. Throws what solve_modes() throws before it searches, but for want of
/// memory. Collective.
SolveEstimate estimate_solve(const Problem& problem, const Options& options, const std::function<bool(const SolveEstimate&)>& may_count);

}  // namespace carillon::eigen

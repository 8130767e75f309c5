// The band of a solve and the body data shared by all stages.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/eigen/check_modes.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/scaling.hpp"
#include "precompute/eigen/slices.hpp"
#include "precompute/eigen/types.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// Ends of the band as scaled eigenvalues, both inclusive.
struct BandLimits {
  double low = 0;
  double high = 0;

  bool is_below(double lambda) const { return lambda < low * (1 - kTolerance); }
  bool is_above(double lambda) const { return lambda > high * (1 + kTolerance); }
  static constexpr double kTolerance = 1e-9;  // A mode this close to an end of the band (relative to lambda) belongs to it.
};

/// A problem, its options and derived data. K and M are scaled so that the band ends near 1; the rigid modes are M-orthonormal in this
/// scaling. Constant after construction.
struct BandProblem {
  /// Both arguments must outlive it. Collective. Throws as make_rigid_modes() and Scaling do.
  BandProblem(const Problem& problem, const Options& options);

  double to_hz(double scaled_lambda) const { return std::sqrt(std::max(scaling.from_scaled(scaled_lambda), 0.0)) / (2 * std::numbers::pi); }
  std::int64_t rigid_count() const { return static_cast<std::int64_t>(rigid.size()); }
  /// Magnitude by which rounding of K moves squared frequencies (scaled lambda).
  double rounding() const;

  const Problem& problem;
  const Options& options;
  comm::Communicator comm;
  PetscInt n = 0;
  PetscInt rows = 0;  // of this rank
  Scaling scaling;
  la::Pencil pencil;
  BandLimits asked;                               // the band of the options
  std::vector<std::int64_t> rigid_per_component;  // (components)
  std::vector<petsc::VecHandle> rigid;
  Operators operators;
  double fastest = 0;  // estimate of the largest eigenvalue
};

/// True if the lower end of the band is well above the rounding of LAPACK, which is relative to the largest eigenvalue.
bool is_dense_exact(const BandProblem& body, const BandLimits& limits);

/// Sentence for the user on the likely cause of a solver error; empty if rounding is far below the band. Not collective: an error may occur
/// on one rank only.
std::string explain_rounding(const BandProblem& body, const BandLimits& limits);

/// Number of modes in the band.
struct BandCounts {
  BandLimits limits;                 // the band; its lower end may have moved up because rounding makes lower counts unusable
  Slice band;                        // counted a little outside the limits
  std::int64_t band_count = 0;       // modes in the band,
  std::int64_t count_below_low = 0;  // and below it
  std::int64_t mechanism_count = 0;  // see Modes
  bool is_low_assumed = false;       // the lower end was not counted: only the rigid modes are assumed to lie below it
  bool is_low_derived = false;       // the count at a shift inside the band gave the count there
};

/// Source of counts: an InertiaCounter, or its record.
struct BandCounter {
  std::function<Inertia(double lambda, double reach, ShiftRule rule)> count_below;
  std::function<void(double lambda)> forget;  // drops a count
};

/// Counts by the inertia of K - lambda M at both ends, and again near zero if more than the rigid modes lies below the band. A very low
/// lower end is not counted: few modes lie below it, and the count at a shift inside the band gives it once all modes up to the shift are
/// found. Collective. Throws SolveError if the counts contradict each other.
BandCounts count_band(const BandProblem& body, const BandCounter& counter);
/// Counts at the lower end that count_band() has assumed. Collective; throws as count_band() does.
void count_low_end(const BandProblem& body, const BandCounter& counter, BandCounts& counts);

}  // namespace carillon::eigen

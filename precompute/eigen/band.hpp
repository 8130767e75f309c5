// The band of a solve, and what all its stages need of the body.
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

/// The ends of the band as scaled eigenvalues; both belong to it.
struct BandLimits {
  double low = 0;
  double high = 0;

  bool is_below(double lambda) const { return lambda < low * (1 - kTolerance); }
  bool is_above(double lambda) const { return lambda > high * (1 + kTolerance); }
  static constexpr double kTolerance = 1e-9;  // A mode this close to an end of the band (relative to lambda) is in it.
};

/// A problem and its options, with what is derived from them. Keeps: the pencil is K and M scaled so that the band ends near 1, and the
/// rigid modes are M-orthonormal in it. Constant from its construction on; every stage takes it by reference.
struct BandProblem {
  /// Both must outlive it. Collective. Throws as make_rigid_modes() and Scaling do.
  BandProblem(const Problem& problem, const Options& options);

  double to_hz(double scaled_lambda) const { return std::sqrt(std::max(scaling.from_scaled(scaled_lambda), 0.0)) / (2 * std::numbers::pi); }
  std::int64_t rigid_count() const { return static_cast<std::int64_t>(rigid.size()); }
  /// Rounding of K moves squared frequencies by about this much (scaled lambda).
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
  double fastest = 0;  // about the greatest eigenvalue
};

/// Whether the lowest eigenvalue of the band stands out of what LAPACK's rounding, a part of the largest of all, does to every one.
bool is_dense_exact(const BandProblem& body, const BandLimits& limits);

/// What makes an error of the solve likely, as a sentence for the user; empty where rounding is far below the band. Not collective: an
/// error may be one rank's alone.
std::string explain_rounding(const BandProblem& body, const BandLimits& limits);

/// How many modes the band holds.
struct BandCounts {
  BandLimits limits;                 // the band; its lower end may have moved up, where rounding makes lower counts unusable
  Slice band;                        // counted a little outside the limits
  std::int64_t band_count = 0;       // modes in the band,
  std::int64_t count_below_low = 0;  // and below it
  std::int64_t mechanism_count = 0;  // see Modes
  bool is_low_assumed = false;       // nothing was counted at the lower end: only the rigid modes are taken to lie below it,
  bool is_low_derived = false;       // which the count at a shift inside has proven
};

/// Where counts come from: an InertiaCounter, or a record of it.
struct BandCounter {
  std::function<Inertia(double lambda, double reach, ShiftRule rule)> count_below;
  std::function<void(double lambda)> forget;  // drops a count
};

/// By the inertia of K - lambda M at both ends, and once more near zero where something other than the rigid modes is below the band. A
/// lower end that is low enough is not counted: as a rule only rigid modes are below it, and the count at a shift inside the band shows it
/// when all modes up to the shift are found. Collective. Throws SolveError where the counts contradict each other.
BandCounts count_band(const BandProblem& body, const BandCounter& counter);
/// Counts at the lower end what count_band() has assumed of it. Collective; throws as it does.
void count_low_end(const BandProblem& body, const BandCounter& counter, BandCounts& counts);

}  // namespace carillon::eigen

// Source: Parlett, The symmetric eigenvalue problem, 1998, section 3.3 (inertia).
#include "precompute/eigen/band.hpp"

#include <fmt/core.h>

#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/predict_cost.hpp"
#include "precompute/eigen/rigid_modes.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr double kDenseRounding = 1e4;   // Factor on epsilon times the largest ratio of the diagonals: far above the rounding of LAPACK.
constexpr double kSparseRounding = 1e3;  // The same: modes a tenth of the lower end's frequency are above the rounding of K.
constexpr double kMechanismTolerance = 1e2;  // Factor on the same: smaller eigenvalues count as zero.
constexpr double kMechanismRatio = 1e-4;     // Relative to the lower end of the band: upper limit for mechanisms.

// Collective.
double find_fastest(const Operators& operators) {
  double fastest = 0;
  for (std::size_t i = 0; i < operators.stiffness_diagonal.size(); ++i)
    fastest = std::max(fastest, operators.stiffness_diagonal[i] / operators.mass_diagonal[i]);
  return operators.comm.max(fastest);
}

// If rounding is near the lower end, the end may have to move, so it is counted.
bool can_assume_low_end(const BandProblem& body) {
  return eigen::can_assume_low_end(body.options) && body.asked.low > kSparseRounding * body.rounding();
}

// The following stages copy K and M.
std::vector<petsc::VecHandle> make_rigid(const comm::Communicator& comm, const Problem& problem, const Options& options,
                                         const la::Pencil& pencil, std::vector<std::int64_t>& per_component) {
  check_memory(comm, calc_copies_bytes(problem), options.memory_limit_bytes, "The eigensolver's copy of K and M");
  return make_rigid_modes(pencil, problem.nodes, per_component);
}

}  // namespace

BandProblem::BandProblem(const Problem& given, const Options& given_options)
    : problem(given),
      options(given_options),
      comm(petsc::get_communicator(given.stiffness)),
      scaling(given.mass, find_ends(given_options).high),
      pencil(scaling.scale(given.stiffness, given.mass)),
      asked{scaling.to_scaled(find_ends(given_options).low), scaling.to_scaled(find_ends(given_options).high)},
      rigid(make_rigid(comm, given, given_options, pencil, rigid_per_component)),
      operators(pencil),
      fastest(find_fastest(operators)) {
  check(MatGetSize(problem.stiffness, &n, nullptr));
  check(MatGetLocalSize(problem.stiffness, &rows, nullptr));
}

double BandProblem::rounding() const { return PETSC_MACHINE_EPSILON * fastest; }

bool is_dense_exact(const BandProblem& body, const BandLimits& limits) { return limits.low > kDenseRounding * body.rounding(); }

std::string explain_rounding(const BandProblem& body, const BandLimits& limits) {
  constexpr double kSafe = 30;  // squared frequencies keep their digits above this multiple of the rounding
  if (limits.low > kSafe * body.rounding()) return {};
  return fmt::format(
      " Rounding of K alone moves the squared frequencies of this body by ({:.2g} Hz)^2, because it is so thin or its elements are so "
      "small: let the band begin at {:.2g} Hz or above.",
      body.to_hz(body.rounding()), body.to_hz(kSafe * body.rounding()));
}

BandCounts count_band(const BandProblem& body, const BandCounter& counter) {
  BandCounts counts;
  const Inertia above = count_below_high(counter.count_below, body.asked.high);
  counts.limits = body.asked;
  counts.band = {find_count_below_low(body.asked.low), body.rigid_count(), above.lambda, above.below};
  if (can_assume_low_end(body) && counts.band.count() > 0) {
    counts.is_low_assumed = true;
    counts.band_count = counts.band.count();
    counts.count_below_low = counts.band.below_low;
  } else {
    count_low_end(body, counter, counts);
  }
  return counts;
}

void count_low_end(const BandProblem& body, const BandCounter& counter, BandCounts& counts) {
  const Inertia below = count_below_low(counter.count_below, body.asked.low);
  Slice& band = counts.band;
  band.low = below.lambda;
  band.below_low = below.below;
  counts.is_low_assumed = false;
  counts.band_count = band.count();
  counts.count_below_low = band.below_low;
  counts.limits.low = std::max(body.asked.low, band.low);
  if (band.below_low < body.rigid_count() || band.count() < 0) {
    throw SolveError(
        fmt::format("The inertia counts {} eigenvalues below {:.6g} Hz and {} below {:.6g} Hz, with {} rigid modes: K or M is not "
                    "valid. Look for inverted elements.",
                    band.below_low, body.to_hz(band.low), band.below_high, body.to_hz(band.high), body.rigid_count()));
  }
  if (band.below_low > body.rigid_count()) {
    constexpr double kReach = 1e-6;
    const double limit = kMechanismRatio * counts.limits.low;
    const Inertia zeros = counter.count_below(std::min(limit, kMechanismTolerance * body.rounding()), kReach, ShiftRule::kMayMoveUp);
    // If rounding hides such slow motions, slow modes would be taken for mechanisms.
    if (zeros.lambda <= limit * (1 + kReach)) counts.mechanism_count = std::max<std::int64_t>(0, zeros.below - body.rigid_count());
    if (zeros.lambda != band.low) counter.forget(zeros.lambda);
  }
}

}  // namespace carillon::eigen

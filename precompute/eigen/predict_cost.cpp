// Method: The symbolic analysis gives the cost of the factorisation; Sylvester's law of inertia counts the modes (inertia.cpp).
// Source: Parlett, The symmetric eigenvalue problem, 1998, section 3.3.
#include "precompute/eigen/predict_cost.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/eigen/check_input.hpp"
#include "precompute/eigen/krylov.hpp"
#include "precompute/eigen/rigid_modes.hpp"
#include "precompute/eigen/scaling.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr double kZeroFraction = 1e-7;  // Relative to high_hz: lower frequencies vanish in the rounding of the highest.
constexpr double kLowEnd = 1e-4;        // Relative to the upper end, in lambda: a lower end below this need not be counted.

double calc_lambda(double freq_hz) {
  const double omega_rad_s = 2 * std::numbers::pi * freq_hz;
  return omega_rad_s * omega_rad_s;
}

}  // namespace

BandEnds find_ends(const Options& options) {
  return {calc_lambda(options.low_hz > 0 ? options.low_hz : kZeroFraction * options.high_hz), calc_lambda(options.high_hz)};
}

bool can_assume_low_end(const Options& options) {
  const BandEnds ends = find_ends(options);
  return !options.max_modes && ends.low <= kLowEnd * ends.high;
}

Inertia count_below_low(const TakeCount& take, double low) { return take(find_count_below_low(low), kEdgeNudge, ShiftRule::kMayMoveUp); }

Inertia count_below_high(const TakeCount& take, double high) { return take(high * (1 + kEdgeNudge), kEdgeNudge, ShiftRule::kExact); }

std::int64_t calc_copies_bytes(const Problem& problem) {
  double entries = 0;
  for (const Mat matrix : {problem.stiffness, problem.mass}) {
    MatInfo info;
    check(MatGetInfo(matrix, MAT_LOCAL, &info));
    entries += 3 * info.nz_used;
  }
  PetscInt rows = 0;
  check(MatGetLocalSize(problem.stiffness, &rows, nullptr));
  entries += 18.0 * rows;
  return static_cast<std::int64_t>(8 * entries);
}

std::int64_t calc_kept_bytes(const Problem& problem) {
  // Blocks of nine numbers, or one number, each with its column index.
  MatInfo k, m;
  check(MatGetInfo(problem.stiffness, MAT_LOCAL, &k));
  check(MatGetInfo(problem.mass, MAT_LOCAL, &m));
  PetscInt rows = 0;
  check(MatGetLocalSize(problem.stiffness, &rows, nullptr));
  return static_cast<std::int64_t>(8.5 * k.nz_used + 1.5 * m.nz_used + 8 * 12.0 * rows);
}

std::int64_t calc_search_bytes(std::int64_t rows, std::int64_t modes, std::int64_t rigid_count) {
  const bool is_cut = modes > kSliceModes;
  const std::int64_t locked = rigid_count + (is_cut ? kSliceModes : 0);  // Locked modes stay where they were found.
  const std::int64_t basis = calc_basis_size(std::min(modes, kSliceModes), locked, !is_cut);
  return rows * 8 * (modes + rigid_count + basis);
}

std::int64_t calc_dense_bytes(std::int64_t unknowns, bool is_root) {
  return static_cast<std::int64_t>(8 * (cost::kDenseCopies + (is_root ? cost::kDenseWork : 0))) * unknowns * unknowns;
}

SolveCost predict_cost(const Problem& problem, const Options& options, const std::function<bool(const SolveCost&)>& may_count) {
  check_input(problem, options);
  SolveCost cost;
  PetscInt n = 0;
  check(MatGetSize(problem.stiffness, &n, nullptr));
  const BandEnds ends = find_ends(options);
  const Scaling scaling(problem.mass, ends.high);
  const la::Pencil pencil = scaling.scale(problem.stiffness, problem.mass);
  std::vector<std::int64_t> per_component;
  const std::vector<petsc::VecHandle> rigid = make_rigid_modes(pencil, problem.nodes, per_component);
  cost.rigid_count = static_cast<std::int64_t>(rigid.size());
  cost.is_dense = n <= kDenseRows || options.method == Method::kDense;
  cost.copies_bytes = calc_copies_bytes(problem);
  cost.copies_kept_bytes = calc_kept_bytes(problem);
  Options unlimited = options;
  unlimited.memory_limit_bytes = 0;
  Seconds seconds;
  FactorStatistics statistics;
  InertiaCounter counter(pencil, problem, unlimited, rigid, seconds, statistics,
                         [&](double lambda) { return std::sqrt(std::max(scaling.from_scaled(lambda), 0.0)) / (2 * std::numbers::pi); });
  const ShiftedFactor& factor = counter.analyse();
  cost.entries = factor.get_entries();
  cost.flops = factor.get_flops();
  cost.factor_bytes = factor.get_peak_bytes();
  cost.factor_kept_bytes = 8 * cost.entries;
  if (!may_count(cost)) return cost;
  const auto take = [&](double lambda, double reach, ShiftRule rule) { return counter.count_below(lambda, reach, rule); };
  const Inertia above = count_below_high(take, scaling.to_scaled(ends.high));
  const Inertia below = count_below_low(take, scaling.to_scaled(ends.low));
  const std::int64_t modes = above.below - below.below;
  cost.modes = std::min(modes, options.max_modes.value_or(modes));
  return cost;
}

}  // namespace carillon::eigen

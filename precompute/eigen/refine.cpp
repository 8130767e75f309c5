// Method: A few bad modes pass through the available operator once more, (K - sigma M)^-1 M phi, and are made orthogonal to the others,
// which corrects rounding of the recurrence and the solves. The rest is treated in groups of neighbours: one step of inverse iteration with
// sigma just below the group damps everything farther from sigma than the group. It is written as a correction, phi - (K - sigma M)^-1 (K
// phi - lambda M phi), so that it converges to the modes of K and M and not to those of the rounded factors, which differ for thin bodies.
// Rayleigh-Ritz in the group separates its members; Gram-Schmidt from the lowest mode up makes the whole set M-orthonormal again. Modes
// still bad are repeated in narrower groups with nearer shifts, down to single modes. The residual of a correct slow mode may be large, as
// the stiffness of fast motions amplifies the rounding of its entries. The inverse removes this: with d = (K - sigma M)^-1 r there is an
// eigenvalue within |lambda - sigma| ||d||_M of lambda, to first order, as for any residual of the inverse.
// Source: Parlett, The symmetric eigenvalue problem, 1998, sections 4.2 (inverse iteration), 11.3 (Rayleigh-Ritz).
#include "precompute/eigen/refine.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "precompute/la/lapack.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using la::LocalColumns;
using petsc::check;

// Ratio of the highest to the lowest lambda of a group, per pass. An error along a mode just beyond the far end of the group decays slowly;
// the passes end with groups of one.
constexpr std::array<double, 6> kSpread{10, 3, 1.3, 1.05, 1.005, 1.0001};
constexpr double kOrthonormal = 5e-11;  // Below this no orthonormalisation is needed.

using Group = std::vector<std::size_t>;

std::vector<Group> group_neighbours(const std::vector<std::size_t>& bad, const std::vector<double>& lambda, double spread) {
  std::vector<Group> groups;
  for (const std::size_t j : bad) {
    if (groups.empty() || lambda[j] > spread * lambda[groups.back().front()]) groups.emplace_back();
    groups.back().push_back(j);
  }
  return groups;
}

// Rayleigh-Ritz in the span of the columns: they become M-orthonormal Ritz vectors. Returns the Ritz values, ascending. work: same number
// of columns.
std::vector<double> calc_ritz(const Operators& operators, const Columns& x, const Columns& work) {
  operators.mass.multiply(x, work);
  la::Matrix m = multiply_transposed(operators.comm, x, work);
  operators.stiffness.multiply(x, work);
  la::Matrix k = multiply_transposed(operators.comm, x, work);
  la::Vector values;
  const int info = la::calc_generalised_eigenpairs(k, m, values);
  if (info != 0) throw SolveError(fmt::format("The modes to be refined are linearly dependent (LAPACK dsygv: {}).", info));
  combine_columns(x, k.data(), x.count);
  return {values.begin(), values.end()};
}

// Normalises the columns in the M norm; first scales them by their largest entry, as a solution near an eigenvalue is huge.
void normalise(const Operators& operators, const Columns& x, const Columns& work) {
  const std::size_t count = x.count;
  const auto scale_all = [&](const std::vector<double>& by) {
    for (int j = 0; j < x.count; ++j) {
      for (std::ptrdiff_t i = 0; i < x.rows; ++i) x.column(j)[i] /= by[j];
    }
  };
  std::vector<double> largest(count, 0.0);
  for (int j = 0; j < x.count; ++j) {
    for (std::ptrdiff_t i = 0; i < x.rows; ++i) largest[j] = std::max(largest[j], std::abs(x.column(j)[i]));
  }
  operators.comm.max(largest);
  scale_all(largest);
  operators.mass.multiply(x, work);
  std::vector<double> norm(count);
  for (int j = 0; j < x.count; ++j) norm[j] = std::inner_product(x.column(j), x.column(j) + x.rows, work.column(j), 0.0);
  operators.comm.sum(norm);
  for (double& square : norm) square = std::sqrt(square);
  scale_all(norm);
}

// K phi - lambda M phi of the modes of a group. work: same number of columns.
void calc_residuals(const Operators& operators, const Group& group, const std::vector<double>& lambda, const Columns& phi,
                    const Columns& residual, const Columns& work) {
  operators.stiffness.multiply(phi, residual);
  operators.mass.multiply(phi, work);
  for (int c = 0; c < phi.count; ++c) {
    const double value = lambda[group[c]];
    for (std::ptrdiff_t i = 0; i < phi.rows; ++i) residual.column(c)[i] -= value * work.column(c)[i];
  }
}

// Factorises at a shift below the group, `nearness` away relative to lambda. Returns the shift.
double factorise_below(const RefineRequest& request, const Group& group, double nearness, const std::vector<double>& lambda,
                       RefineCost& cost) {
  constexpr int kShifts = 6;
  const petsc::WorkScope scope(petsc::WorkPhase::kFactor);
  const double low = lambda[group.front()];
  do {
    ShiftedFactor& factor = request.get_factor();
    for (int i = 0; i < kShifts; ++i) {
      const double sigma = low * (1 - nearness * (1 + 1e-2 * i));
      ++cost.factorisations;
      if (factor.factorise(sigma)) return sigma;
    }
  } while (request.switch_to_pivoting_solver && request.switch_to_pivoting_solver());
  throw SolveError("K - sigma M is singular all around a mode: the mesh has nodes without mass or stiffness.");
}

// The modes of a group and their corrections (K - sigma M)^-1 (K phi - lambda M phi).
struct Corrections {
  Corrections(const RefineRequest& request, ShiftedFactor& factor, const Group& group, const std::vector<double>& lambda,
              const Columns& all, RefineCost& cost)
      : rows(static_cast<std::size_t>(all.rows)),
        space(3 * rows * group.size()),
        phi{space.data(), all.rows, all.rows, static_cast<int>(group.size())},
        d{space.data() + rows * group.size(), all.rows, all.rows, phi.count},
        work{space.data() + 2 * rows * group.size(), all.rows, all.rows, phi.count} {
    for (std::size_t j = 0; j < group.size(); ++j)
      std::copy_n(all.column(static_cast<int>(group[j])), rows, phi.column(static_cast<int>(j)));
    calc_residuals(*request.operators, group, lambda, phi, d, work);
    factor.solve(d.values, d.values, d.stride, d.count);
    cost.solves += d.count;
  }
  Corrections(const Corrections&) = delete;
  Corrections& operator=(const Corrections&) = delete;

  /// ||d||_M |lambda - sigma| / lambda of each.
  std::vector<double> calc_bounds(const RefineRequest& request, const Group& group, const std::vector<double>& lambda, double sigma) {
    request.operators->mass.multiply(d, work);
    std::vector<double> bounds;
    for (int c = 0; c < d.count; ++c) bounds.push_back(std::inner_product(d.column(c), d.column(c) + rows, work.column(c), 0.0));
    request.operators->comm.sum(bounds);
    for (std::size_t c = 0; c < group.size(); ++c) bounds[c] = std::sqrt(bounds[c]) * std::abs(lambda[group[c]] - sigma) / lambda[group[c]];
    return bounds;
  }

  /// Replaces the modes of the group by Ritz vectors in the span of the corrected modes, and lambda by their values.
  void apply(const RefineRequest& request, const Group& group, std::vector<double>& lambda, const Columns& all) {
    for (std::size_t i = 0; i < rows * group.size(); ++i) phi.values[i] -= d.values[i];
    normalise(*request.operators, phi, work);
    const std::vector<double> ritz = calc_ritz(*request.operators, phi, work);
    for (std::size_t j = 0; j < group.size(); ++j) {
      lambda[group[j]] = ritz[j];
      std::copy_n(phi.column(static_cast<int>(j)), rows, all.column(static_cast<int>(group[j])));
    }
  }

  std::size_t rows = 0;
  std::vector<double> space;
  Columns phi, d, work;
};

// Improves the modes of a group. `nearness`: distance of the shift below the group, relative to lambda.
void improve_group(const RefineRequest& request, const Group& group, double nearness, std::vector<double>& lambda, Mat shapes,
                   RefineCost& cost) {
  factorise_below(request, group, nearness, lambda, cost);
  const LocalColumns access(shapes);
  const Columns all = access.view();
  Corrections(request, request.get_factor(), group, lambda, all, cost).apply(request, group, lambda, all);
}

Group find_above(const ModeErrors& errors, double tolerance) {
  Group above;
  for (std::size_t j = 0; j < errors.residual.size(); ++j)
    if (errors.residual[j] > tolerance) above.push_back(j);
  return above;
}

// Bounds the errors of modes above the tolerance with the existing factor, at any shift: modes limited by rounding need no factorisation of
// their own.
void bound_at_hand(const RefineRequest& request, const std::vector<double>& lambda, Mat shapes, ModeErrors& errors, RefineCost& cost) {
  if (request.at_hand == nullptr) return;
  constexpr std::size_t kBlock = 16;  // columns; limits memory
  const Group above = find_above(errors, request.tolerance);
  const LocalColumns access(shapes);
  const Columns all = access.view();
  for (std::size_t first = 0; first < above.size(); first += kBlock) {
    const Group block(above.begin() + static_cast<std::ptrdiff_t>(first),
                      above.begin() + static_cast<std::ptrdiff_t>(std::min(above.size(), first + kBlock)));
    Corrections corrections(request, *request.at_hand, block, lambda, all, cost);
    const std::vector<double> bounds = corrections.calc_bounds(request, block, lambda, request.at_hand->get_shift());
    for (std::size_t c = 0; c < block.size(); ++c) errors.residual[block[c]] = std::min(errors.residual[block[c]], bounds[c]);
  }
}

// Passes the bad modes through the available operator, at any shift, and removes the components along other modes. Modes that do not
// improve are kept. The other modes do not change, so they need no new measurement.
void polish(const RefineRequest& request, const Group& bad, std::vector<double>& lambda, Mat shapes, ModeErrors& errors, RefineCost& cost) {
  const Operators& operators = *request.operators;
  const LocalColumns access(shapes);
  const Columns all = access.view();
  PetscInt n = 0;
  check(MatGetSize(shapes, &n, nullptr));
  petsc::MatHandle polished;
  check(MatCreateDense(operators.comm, access.rows, PETSC_DECIDE, n, static_cast<PetscInt>(bad.size()), nullptr, polished.out()));
  check(MatAssemblyBegin(polished, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(polished, MAT_FINAL_ASSEMBLY));
  std::vector<double> ritz;
  double overlap = 0;  // largest final overlap with other modes
  {
    const LocalColumns own(polished);
    const Columns x = own.view();
    const std::size_t size = static_cast<std::size_t>(x.rows) * bad.size();
    std::vector<double> space(2 * size);
    const Columns phi{space.data(), x.rows, x.rows, x.count};
    const Columns work{space.data() + size, x.rows, x.rows, x.count};
    for (std::size_t j = 0; j < bad.size(); ++j) std::copy_n(all.column(static_cast<int>(bad[j])), x.rows, phi.column(static_cast<int>(j)));
    // (lambda - sigma) (K - sigma M)^-1 M phi, as a correction: the rounding of the solve is then relative to the correction, not to phi.
    calc_residuals(operators, bad, lambda, phi, x, work);
    request.at_hand->solve(x.values, x.values, x.stride, x.count);
    cost.solves += x.count;
    for (int j = 0; j < x.count; ++j)
      for (std::ptrdiff_t i = 0; i < x.rows; ++i) x.column(j)[i] = phi.column(j)[i] - x.column(j)[i];
    for (int pass = 0; pass < 3; ++pass) {
      normalise(operators, x, work);
      operators.mass.multiply(x, work);
      la::Matrix products = multiply_transposed(operators.comm, all, work);
      for (const std::size_t j : bad) products.row(static_cast<Eigen::Index>(j)).setZero();
      overlap = 0;
      for (const double product : products.reshaped()) overlap = std::max(overlap, std::abs(product));
      if (pass < 2) subtract_product(all, products.data(), all.count, x);
    }
    ritz = calc_ritz(operators, x, work);
  }
  const ModeErrors corrected = normalise_and_measure(operators, ritz, polished);
  double before = 0, after = 0;
  for (std::size_t j = 0; j < bad.size(); ++j) {
    before = std::max(before, errors.residual[bad[j]] / std::max(request.tolerance, errors.floor[bad[j]]));
    after = std::max(after, corrected.residual[j] / std::max(request.tolerance, corrected.floor[j]));
  }
  if (!(after < before) || std::max(overlap, corrected.orthonormality) > kOrthonormal) return;
  const LocalColumns own(polished);
  for (std::size_t j = 0; j < bad.size(); ++j) {
    std::copy_n(own.column(static_cast<PetscInt>(j)), own.rows, all.column(static_cast<int>(bad[j])));
    lambda[bad[j]] = ritz[j];
    errors.residual[bad[j]] = corrected.residual[j];
    errors.floor[bad[j]] = corrected.floor[j];
  }
  errors.orthonormality = std::max({errors.orthonormality, overlap, corrected.orthonormality});
}

// Gram-Schmidt must proceed upwards in lambda, and refined values may have changed order.
ModeErrors measure_orthonormal(const RefineRequest& request, std::vector<double>& lambda, Mat shapes) {
  ModeErrors errors = normalise_and_measure(*request.operators, lambda, shapes);
  sort_modes(lambda, shapes, errors);
  if (errors.orthonormality > kOrthonormal) {
    orthonormalise_shapes(*request.operators, shapes);
    errors = normalise_and_measure(*request.operators, lambda, shapes);
    sort_modes(lambda, shapes, errors);
  }
  return errors;
}

}  // namespace

bool is_accepted(const ModeErrors& errors, std::size_t j, double tolerance) {
  return errors.residual[j] <= std::max(tolerance, errors.floor[j]);
}

RefineCost bound_error_by_inverse_residual(const RefineRequest& request, std::vector<double>& lambda, Mat shapes, ModeErrors& errors) {
  // A mode below the shift that is nearer to it than the upper end of the group would grow: groups are narrow and shifts near, but not so
  // near that rounding of the factors dominates.
  constexpr std::array<std::array<double, 2>, 4> kRounds{{{1.2, 0.1}, {1.02, 0.01}, {1.005, 0.01}, {1.005, 0.01}}};  // spread, nearness
  RefineCost cost;
  for (std::size_t round = 0;; ++round) {
    const auto [spread, nearness] = kRounds[round];
    if (round == 0) bound_at_hand(request, lambda, shapes, errors, cost);
    const Group above = find_above(errors, request.tolerance);
    std::vector<double> bounded = errors.residual;
    bool is_corrected = false;
    for (const Group& group : group_neighbours(above, lambda, spread)) {
      const double sigma = factorise_below(request, group, nearness, lambda, cost);
      const LocalColumns access(shapes);
      const Columns all = access.view();
      Corrections corrections(request, request.get_factor(), group, lambda, all, cost);
      const std::vector<double> bounds = corrections.calc_bounds(request, group, lambda, sigma);
      double worst = 0;
      for (std::size_t c = 0; c < group.size(); ++c) {
        const std::size_t j = group[c];
        bounded[j] = std::min(bounded[j], bounds[c]);
        worst = std::max(worst, bounded[j]);
      }
      if (worst <= request.tolerance || round + 1 == kRounds.size()) continue;
      corrections.apply(request, group, lambda, all);
      is_corrected = true;
    }
    if (!is_corrected) {
      errors.residual = bounded;
      for (const std::size_t j : above) errors.floor[j] = std::min(errors.floor[j], bounded[j]);
      return cost;
    }
    errors = measure_orthonormal(request, lambda, shapes);
  }
}

RefineCost refine_modes(const RefineRequest& request, std::vector<double>& lambda, Mat shapes, ModeErrors& errors) {
  RefineCost cost;
  errors = measure_orthonormal(request, lambda, shapes);
  constexpr std::size_t kFew = 32;
  const Group above = find_above(errors, request.tolerance);
  if (request.at_hand != nullptr && !above.empty() && above.size() <= kFew) {
    polish(request, above, lambda, shapes, errors, cost);
    sort_modes(lambda, shapes, errors);
  }
  bound_at_hand(request, lambda, shapes, errors, cost);
  for (std::size_t pass = 0; pass < kSpread.size(); ++pass) {
    std::vector<std::size_t> bad;
    for (std::size_t j = 0; j < lambda.size(); ++j) {
      const bool is_good = pass == 0 ? errors.residual[j] <= request.tolerance : is_accepted(errors, j, request.tolerance);
      if (!is_good) bad.push_back(j);
    }
    if (bad.empty()) return cost;
    const double spread = kSpread[pass];
    for (const Group& group : group_neighbours(bad, lambda, spread)) {
      improve_group(request, group, std::min(0.1, 0.1 * (spread - 1)), lambda, shapes, cost);
    }
    errors = measure_orthonormal(request, lambda, shapes);
  }
  return cost;
}

}  // namespace carillon::eigen

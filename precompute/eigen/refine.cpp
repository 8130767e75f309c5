// Method:     Bad modes are taken in groups of neighbours. One step of inverse iteration, (K - sigma M)^-1 M phi with sigma just below the
//             group, damps everything farther from sigma than the group is; Rayleigh-Ritz within the group parts its members; Gram-Schmidt
//             from the lowest mode up makes the whole set M-orthonormal again. What is still bad is tried again in narrower groups, whose
//             shifts are nearer; the narrowest hold a single mode.
// Source:     Parlett, The symmetric eigenvalue problem, 1998, sections 4.2 (inverse iteration), 11.3 (Rayleigh-Ritz).
// Deviations: none.
#include "precompute/eigen/refine.hpp"

#include <fmt/core.h>
#include <petscblaslapack.h>

#include <algorithm>
#include <array>

#include "precompute/eigen/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/config/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

// Highest lambda of a group over its lowest, pass by pass. An error in the direction of a mode just outside the group's far end decays
// slowly; the passes end with groups of one.
constexpr std::array<double, 6> kSpread{10, 3, 1.3, 1.05, 1.005, 1.0001};
constexpr double kOrthonormal = 1e-11;  // Good enough without another orthonormalisation.

using Group = std::vector<std::size_t>;

std::vector<Group> group_neighbours(const std::vector<std::size_t>& bad, const std::vector<double>& lambda, double spread) {
  std::vector<Group> groups;
  for (const std::size_t j : bad) {
    if (groups.empty() || lambda[j] > spread * lambda[groups.back().front()]) groups.emplace_back();
    groups.back().push_back(j);
  }
  return groups;
}

// Rayleigh-Ritz in the span of the columns: they become M-orthonormal Ritz vectors, their ascending Ritz values are returned.
std::vector<double> calc_ritz(Mat stiffness, Mat mass, Mat columns) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(stiffness), &comm));
  petsc::MatHandle product;
  check(MatMatMult(mass, columns, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.out()));
  std::vector<double> m;
  {
    const LocalColumns x(columns);
    const LocalColumns m_x(product);
    m = calc_gram(comm, x, m_x);
  }
  check(MatMatMult(stiffness, columns, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.out()));
  const LocalColumns x(columns);
  const LocalColumns work(product);
  std::vector<double> k = calc_gram(comm, x, work);
  std::vector<double> values(static_cast<std::size_t>(x.columns));
  PetscBLASInt type = 1;
  PetscBLASInt size = x.columns;
  PetscBLASInt info = 0;
  PetscBLASInt room = 64 * size + 3 * size;
  std::vector<double> space(static_cast<std::size_t>(room));
  LAPACKsygv_(&type, "V", "L", &size, k.data(), &size, m.data(), &size, values.data(), space.data(), &room, &info);
  if (info != 0) throw SolveError(fmt::format("The modes to be refined are linearly dependent (LAPACK dsygv: {}).", info));
  for (PetscInt j = 0; j < x.columns; ++j) std::copy_n(x.column(j), x.rows, work.column(j));
  multiply_columns(work, k, x);
  return values;
}

void copy_column(Mat from, std::size_t from_column, Mat to, std::size_t to_column) {
  const LocalColumns source(from);
  const LocalColumns target(to);
  std::copy_n(source.column(static_cast<PetscInt>(from_column)), source.rows, target.column(static_cast<PetscInt>(to_column)));
}

// x <- (K - sigma M)^-1 M x, M-normalised.
void iterate_inversely(Mat mass, ShiftedFactor& factor, Mat columns, PetscInt j, Vec right) {
  Vec x = nullptr;
  check(MatDenseGetColumnVec(columns, j, &x));
  check(MatMult(mass, x, right));
  factor.solve(right, x);
  PetscReal largest = 0;  // Near an eigenvalue the solution is huge: first to an ordinary size, then to the M-norm.
  check(VecNorm(x, NORM_INFINITY, &largest));
  check(VecScale(x, 1 / largest));
  PetscScalar square = 0;
  check(MatMult(mass, x, right));
  check(VecDot(x, right, &square));
  check(VecScale(x, 1 / std::sqrt(square)));
  check(MatDenseRestoreColumnVec(columns, j, &x));
}

// Replaces the group's modes by better ones. `nearness` is the distance of the shift below the group, relative to lambda.
void improve_group(const RefineRequest& request, const Group& group, double nearness, std::vector<double>& lambda, Mat shapes,
                   RefineCost& cost) {
  ShiftedFactor& factor = request.get_factor();
  double sigma = lambda[group.front()] * (1 - nearness);
  constexpr int kNudges = 5;
  for (int i = 0; !factor.factorise(sigma); ++i) {
    if (i == kNudges) throw SolveError("K - sigma M is singular all around a mode: the mesh has nodes without mass or stiffness.");
    sigma -= 1e-2 * nearness * lambda[group.front()];
  }
  ++cost.factorisations;
  cost.solves += static_cast<std::int64_t>(group.size());
  MPI_Comm comm = MPI_COMM_NULL;
  PetscInt rows = 0;
  PetscInt n = 0;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(shapes), &comm));
  check(MatGetLocalSize(shapes, &rows, nullptr));
  check(MatGetSize(shapes, &n, nullptr));
  petsc::MatHandle columns;
  petsc::VecHandle right;
  check(MatCreateDense(comm, rows, PETSC_DECIDE, n, static_cast<PetscInt>(group.size()), nullptr, columns.out()));
  check(MatCreateVecs(request.stiffness, right.out(), nullptr));
  for (std::size_t j = 0; j < group.size(); ++j) copy_column(shapes, group[j], columns, j);
  check(MatAssemblyBegin(columns, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(columns, MAT_FINAL_ASSEMBLY));
  for (std::size_t j = 0; j < group.size(); ++j) iterate_inversely(request.mass, factor, columns, static_cast<PetscInt>(j), right);
  const std::vector<double> ritz = calc_ritz(request.stiffness, request.mass, columns);
  for (std::size_t j = 0; j < group.size(); ++j) {
    lambda[group[j]] = ritz[j];
    copy_column(columns, j, shapes, group[j]);
  }
}

// Gram-Schmidt must go upwards in lambda, and refined values may have passed their neighbours.
ModeErrors measure_orthonormal(const RefineRequest& request, std::vector<double>& lambda, Mat shapes) {
  ModeErrors errors = normalise_and_measure(request.stiffness, request.mass, lambda, shapes);
  sort_modes(lambda, shapes, errors);
  if (errors.orthonormality > kOrthonormal) {
    orthonormalise_shapes(request.mass, shapes);
    errors = normalise_and_measure(request.stiffness, request.mass, lambda, shapes);
    sort_modes(lambda, shapes, errors);
  }
  return errors;
}

}  // namespace

bool is_accepted(const ModeErrors& errors, std::size_t j, double tolerance) {
  return errors.residual[j] <= std::max(tolerance, errors.floor[j]);
}

RefineCost refine_modes(const RefineRequest& request, std::vector<double>& lambda, Mat shapes, ModeErrors& errors) {
  RefineCost cost;
  errors = measure_orthonormal(request, lambda, shapes);
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

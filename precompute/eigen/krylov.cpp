// Method: Block Lanczos or Krylov-Schur on (K - sigma M)^-1 M in the M inner product; eigenvalues theta of the operator give
// lambda = sigma + 1 / theta. The starting block is a fixed function of the node positions, so results do not depend on the partition.
// Source: Ericsson, Ruhe, Math. Comp. 35, 1980 (shift and invert). Block Lanczos: block_lanczos.cpp.
#include "precompute/eigen/krylov.hpp"

#include <petscmat.h>
#include <slepcbv.h>
#include <slepceps.h>

#include <algorithm>
#include <bit>
#include <exception>
#include <new>
#include <numeric>
#include <vector>

#include "precompute/eigen/block_lanczos.hpp"
#include "precompute/eigen/found_modes.hpp"
#include "precompute/eigen/locked_modes.hpp"
#include "precompute/eigen/ritz.hpp"
#include "precompute/eigen/shift_invert.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/noise.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

/// factor * matrix for products with vectors, without a copy of the matrix, which must outlive this object.
class ScaledMatrix {
 public:
  /// Collective.
  ScaledMatrix(Mat matrix, double factor);
  ScaledMatrix(const ScaledMatrix&) = delete;
  ScaledMatrix& operator=(const ScaledMatrix&) = delete;

  operator Mat() const { return shell_; }

 private:
  static PetscErrorCode multiply(Mat shell, Vec x, Vec y);

  Mat matrix_;
  double factor_;
  petsc::MatHandle shell_;
};

ScaledMatrix::ScaledMatrix(Mat matrix, double factor) : matrix_(matrix), factor_(factor) {
  PetscInt rows = 0, n = 0;
  check(MatGetLocalSize(matrix, &rows, nullptr));
  check(MatGetSize(matrix, &n, nullptr));
  check(MatCreateShell(petsc::get_communicator(matrix), rows, rows, n, n, this, shell_.out()));
  check(MatShellSetOperation(shell_, MATOP_MULT, reinterpret_cast<void (*)()>(multiply)));
  check(MatShellSetOperation(shell_, MATOP_MULT_TRANSPOSE, reinterpret_cast<void (*)()>(multiply)));  // symmetric
}

PetscErrorCode ScaledMatrix::multiply(Mat shell, Vec x, Vec y) {
  const ScaledMatrix* scaled = nullptr;
  PetscCall(MatShellGetContext(shell, &scaled));
  PetscCall(MatMult(scaled->matrix_, x, y));
  return VecScale(y, scaled->factor_);
}

// Method: SLEPc's Krylov-Schur seeks the eigenvalues nearest to the shift, with the available factor as operator. Its Gram-Schmidt repeats
// as SLEPc decides: skipping the second pass occasionally lost orthogonality.
// Source: Stewart, A Krylov-Schur algorithm for large eigenproblems, SIAM J. Matrix Anal. Appl. 23(3), 2001; Hernandez, Roman, Vidal,
// SLEPc, ACM TOMS 31(3), 2005.

// Own rows of a vector, read and written.
class LocalVector {
 public:
  explicit LocalVector(Vec vector) : vector_(vector) {
    PetscInt rows = 0;
    check(VecGetLocalSize(vector, &rows));
    check(VecGetArray(vector, &values_));
    column = {values_, rows, rows, 1};
  }
  ~LocalVector() { (void)VecRestoreArray(vector_, &values_); }
  LocalVector(const LocalVector&) = delete;
  LocalVector& operator=(const LocalVector&) = delete;

  Columns column;

 private:
  Vec vector_;
  PetscScalar* values_ = nullptr;
};

/// Runs the work of a callback; converts an exception to a PETSc error with the same text, which check() converts back.
template <typename Work>
PetscErrorCode guard(Work&& work) {
  try {
    work();
  } catch (const std::bad_alloc&) {
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_MEM, "out of memory");
  } catch (const std::exception& error) {
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_LIB, "%s", error.what());
  }
  return 0;
}

PetscErrorCode apply_inverse(PC pc, Vec b, Vec x) {
  return guard([&] {
    ShiftInvert* inverse = nullptr;
    check(PCShellGetContext(pc, &inverse));
    check(VecCopy(b, x));
    const LocalVector own(x);
    inverse->apply(own.column, own.column);
  });
}

PetscErrorCode calc_error(EPS, PetscScalar theta, PetscScalar, PetscReal residual, PetscReal* error, void* request) {
  *error = calc_ritz_error(static_cast<const KrylovRequest*>(request)->sigma, theta, residual);
  return 0;
}

// Context of report_progress().
struct Run {
  explicit Run(const KrylovRequest& of) : request(of), inverse(*of.factor, of.sigma, [this] { report(); }) {}
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  void report() const {
    if (request.progress) request.progress(converged, inverse.get_solves());
  }

  const KrylovRequest& request;
  ShiftInvert inverse;
  std::int64_t converged = 0;
};

PetscErrorCode report_progress(EPS, PetscInt, PetscInt converged, PetscScalar*, PetscScalar*, PetscReal*, PetscInt, void* context) {
  auto& run = *static_cast<Run*>(context);
  run.converged = converged;
  run.report();
  return 0;
}

void set_operator(EPS eps, double sigma, ShiftInvert& inverse, Mat stiffness, Mat mass) {
  ST st = nullptr;
  KSP ksp = nullptr;
  PC pc = nullptr;
  check(EPSSetOperators(eps, stiffness, mass));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetTarget(eps, sigma));
  check(EPSGetST(eps, &st));
  check(STSetType(st, STSINVERT));
  check(STSetShift(st, sigma));
  check(STSetMatMode(st, ST_MATMODE_SHELL));  // K - sigma M is formed where it is factorised
  check(STGetKSP(st, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCSHELL));
  check(PCShellSetContext(pc, &inverse));
  check(PCShellSetApply(pc, apply_inverse));
}

// A basis of this size usually converges without a restart, which discards half of the solves. A shift inside the band has modes on both
// sides and needs less.
void set_sizes(EPS eps, const KrylovRequest& request, PetscInt locked) {
  PetscInt n = 0;
  check(MatGetSize(request.pencil.stiffness, &n, nullptr));
  const PetscInt room = n - locked;
  const PetscInt wanted = std::min(request.nearest, room);
  const PetscInt columns = std::min(room, wanted + (request.sigma > 0 ? wanted / 2 : wanted) + 30);
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  check(EPSSetDimensions(eps, wanted, columns, columns));
  check(EPSSetTolerances(eps, request.tolerance, request.max_steps > 0 ? request.max_steps : PETSC_DEFAULT));
}

void set_deflation_space(EPS eps, Mat stiffness, const LockedModes& locked) {
  if (locked.count() == 0) return;
  std::vector<petsc::VecHandle> vectors;
  for (const Columns& set : locked.sets) {
    for (int j = 0; j < set.count; ++j) {
      check(MatCreateVecs(stiffness, vectors.emplace_back().out(), nullptr));
      std::copy_n(set.column(j), set.rows, LocalVector(vectors.back()).column.values);
    }
  }
  std::vector<Vec> plain(vectors.begin(), vectors.end());
  check(EPSSetDeflationSpace(eps, static_cast<PetscInt>(plain.size()), plain.data()));
}

/// run_krylov() by the Krylov-Schur method, orthogonal to `locked`. Collective.
KrylovStatistics run_krylov_schur(const KrylovRequest& request, const LockedModes& locked, FoundModes& found) {
  const la::Pencil& pencil = request.pencil;
  const ScaledMatrix stiffness(pencil.stiffness, pencil.stiffness_factor);
  const ScaledMatrix mass(pencil.mass, pencil.mass_factor);
  Run run(request);
  petsc::EpsHandle eps;
  check(EPSCreate(petsc::get_communicator(pencil.stiffness), eps.out()));
  check(EPSSetType(eps, EPSKRYLOVSCHUR));
  set_operator(eps, request.sigma, run.inverse, stiffness, mass);
  check(EPSSetPurify(eps, PETSC_FALSE));
  check(EPSSetConvergenceTestFunction(eps, calc_error, const_cast<KrylovRequest*>(&request), nullptr));
  set_sizes(eps, request, locked.count());
  set_deflation_space(eps, pencil.stiffness, locked);
  if (request.progress) check(EPSMonitorSet(eps, report_progress, &run, nullptr));
  check(EPSSolve(eps));

  PetscInt converged = 0;
  check(EPSGetConverged(eps, &converged));
  petsc::VecHandle shape;
  check(MatCreateVecs(pencil.stiffness, shape.out(), nullptr));
  double highest = request.sigma;
  for (PetscInt i = 0; i < converged; ++i) {
    PetscScalar lambda = 0;
    check(EPSGetEigenvalue(eps, i, &lambda, nullptr));
    if (lambda < request.low || lambda > request.high) continue;
    check(EPSGetEigenvector(eps, i, shape, nullptr));
    found.add(lambda, LocalVector(shape).column.values);
    highest = std::max(highest, lambda);
  }
  return {run.inverse.get_solves(), run.inverse.get_seconds(), std::min(highest, request.high)};
}

constexpr PetscInt kBlock = 16;

// Sizes of a run of block Lanczos.
struct Sizes {
  Sizes(const KrylovRequest& request, PetscInt n, PetscInt locked) : wanted(std::min(request.count, n - locked)) {
    const std::int64_t predicted = calc_basis_size(wanted, locked, request.is_count_known) - kBlock;  // without residuals
    columns = static_cast<PetscInt>(std::min<std::int64_t>(n, std::max<std::int64_t>(predicted, wanted + 3 * kBlock)));
    room = static_cast<int>(std::min(columns, n - locked));
    block = std::min(static_cast<int>(kBlock), std::max(room, 1));
    max_steps = request.max_steps > 0 ? request.max_steps : std::max(200, static_cast<int>(20 * columns / kBlock));
  }

  PetscInt wanted = 0, columns = 0;
  int room = 0, block = 0, max_steps = 0;
};

// Pseudo-random number in (-1/2, 1/2) from a position and two more numbers.
double make_noise(const Vec3& x, std::uint64_t a, std::uint64_t b) {
  std::uint64_t state = a * 0x9E3779B97F4A7C15ull + b * 0xD1B54A32D192ED03ull;
  for (const double coordinate : x) {
    state = petsc::scramble(state ^ std::bit_cast<std::uint64_t>(coordinate + 0.0));  // + 0.0: minus zero becomes zero
  }
  return petsc::to_noise(state);
}

std::vector<petsc::VecHandle> make_starting_block(const KrylovRequest& request) {
  std::vector<petsc::VecHandle> vectors(kBlock);
  for (std::size_t j = 0; j < vectors.size(); ++j) {
    check(MatCreateVecs(request.pencil.stiffness, vectors[j].out(), nullptr));
    PetscScalar* values = nullptr;
    check(VecGetArray(vectors[j], &values));
    for (std::size_t node = 0; node < request.nodes_m->size(); ++node) {
      for (std::size_t d = 0; d < 3; ++d)
        values[3 * node + d] = make_noise((*request.nodes_m)[node], 3 * j + d + 1, static_cast<std::uint64_t>(request.round));
    }
    check(VecRestoreArray(vectors[j], &values));
  }
  return vectors;
}

// Memory of the basis and the residuals, with the M-orthonormal starting block in its first columns.
class BasisMemory {
 public:
  BasisMemory(const KrylovRequest& request, const Sizes& sizes, PetscInt rows, PetscInt n)
      : mass_(request.pencil.mass, request.pencil.mass_factor) {
    check(BVCreate(petsc::get_communicator(request.pencil.mass), bv_.out()));
    check(BVSetSizes(bv_, rows, n, sizes.columns + kBlock));
    check(BVSetType(bv_, BVSVEC));
    check(BVSetMatrix(bv_, mass_, PETSC_FALSE));
    const std::vector<petsc::VecHandle> vectors = make_starting_block(request);
    std::vector<Vec> plain(vectors.begin(), vectors.end());
    PetscInt count = kBlock;
    check(BVInsertVecs(bv_, 0, &count, plain.data(), PETSC_TRUE));
    check(BVGetArray(bv_, &values_));
    columns = {values_, rows, rows, sizes.room + sizes.block};
  }
  ~BasisMemory() {
    if (values_ != nullptr) (void)BVRestoreArray(bv_, &values_);
  }
  BasisMemory(const BasisMemory&) = delete;
  BasisMemory& operator=(const BasisMemory&) = delete;

  Columns columns;

 private:
  ScaledMatrix mass_;
  petsc::BvHandle bv_;
  PetscScalar* values_ = nullptr;
};

RitzGoal make_goal(const KrylovRequest& request, const Sizes& sizes) {
  return {.low = request.low,
          .high = request.high,
          .wanted = sizes.wanted,
          .is_count_known = request.is_count_known,
          .sigma = request.sigma,
          .tolerance = request.tolerance};
}

// Indices by ascending lambda, equal ones in reverse order.
std::vector<int> sort_ascending(const std::vector<double>& lambda) {
  std::vector<int> order(lambda.size());
  std::iota(order.rbegin(), order.rend(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return lambda[a] < lambda[b]; });
  return order;
}

KrylovStatistics run_block_lanczos(const KrylovRequest& request, const LockedModes& locked, FoundModes& found) {
  PetscInt n = 0, rows = 0, first_row = 0;
  check(MatGetSize(request.pencil.stiffness, &n, nullptr));
  check(MatGetLocalSize(request.pencil.stiffness, &rows, nullptr));
  check(MatGetOwnershipRange(request.pencil.stiffness, &first_row, nullptr));
  const Sizes sizes(request, n, locked.count());
  const BasisMemory memory(request, sizes, rows, n);
  std::vector<double> lambda;  // of the converged pairs at the last Ritz step
  ShiftInvert inverse(*request.factor, request.sigma, [&] {
    if (request.progress) request.progress(static_cast<std::int64_t>(lambda.size()), inverse.get_solves());
  });
  InnerProduct inner(petsc::get_communicator(request.pencil.stiffness), *request.mass_blocks, rows, sizes.block);
  LanczosBasis basis(memory.columns, sizes.room, sizes.block);
  BlockLanczos lanczos({inverse, inner, basis, locked, n, first_row}, make_goal(request, sizes), sizes.max_steps, request.checkpoint);
  bool is_solved = false;
  const BlockLanczos::End end = lanczos.run([&](const RitzPairs& pairs, const RitzSelection& selection, int steps) {
    lambda.clear();
    for (int j = 0; j < std::min<std::int64_t>(selection.converged, pairs.theta.size()); ++j)
      lambda.push_back(to_lambda(request.sigma, pairs.theta[selection.order[j]]));
    is_solved = selection.is_complete && (std::ssize(lambda) >= sizes.wanted || steps < sizes.max_steps);
    if (request.progress) request.progress(static_cast<std::int64_t>(lambda.size()), inverse.get_solves());
    return selection.is_complete || steps >= sizes.max_steps;
  });
  KrylovStatistics statistics{inverse.get_solves(), inverse.get_seconds(), 0};
  if (end == BlockLanczos::End::kCheckpointed) return statistics;
  if (end == BlockLanczos::End::kExhausted) {
    lambda.clear();
    is_solved = true;
  }
  double highest = request.sigma;
  for (const int j : sort_ascending(lambda)) {
    if (lambda[j] < request.low || lambda[j] > request.high) continue;
    found.add(lambda[j], memory.columns.column(j));
    highest = std::max(highest, lambda[j]);
  }
  statistics.solved_to = is_solved ? request.high : std::min(highest, request.high);
  return statistics;
}

}  // namespace

std::int64_t calc_basis_size(std::int64_t wanted, std::int64_t locked, bool is_count_known) {
  const std::int64_t neighbours = std::min(locked, wanted / 2) + (is_count_known ? 0 : wanted / 4);
  return 2 * wanted + 10 * kBlock + neighbours;
}

KrylovStatistics run_krylov(const KrylovRequest& request, FoundModes& found) {
  const LockedModes locked = found.find_above(request.locked_above);
  if (request.method == Method::kKrylovSchur) return run_krylov_schur(request, locked, found);
  return run_block_lanczos(request, locked, found);
}

}  // namespace carillon::eigen

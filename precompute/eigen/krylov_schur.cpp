// Method: SLEPc's Krylov-Schur seeks the eigenvalues nearest to the shift, with the available factor as operator. Its Gram-Schmidt repeats
// as SLEPc decides: skipping the second pass occasionally lost orthogonality.
// Source: Stewart, A Krylov-Schur algorithm for large eigenproblems, SIAM J. Matrix Anal. Appl. 23(3), 2001; Hernandez, Roman, Vidal,
// SLEPc, ACM TOMS 31(3), 2005.
#include "precompute/eigen/krylov_schur.hpp"

#include <slepceps.h>

#include <algorithm>
#include <vector>

#include "precompute/eigen/ritz.hpp"
#include "precompute/eigen/scaled_matrix.hpp"
#include "precompute/eigen/shift_invert.hpp"
#include "precompute/petsc/guard.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;
using petsc::guard;

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

}  // namespace

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

}  // namespace carillon::eigen

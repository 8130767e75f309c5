// Method:     Krylov-Schur (thick-restart Lanczos) on (K - sigma M)^-1 M in the M inner product; eigenvalues theta of the operator give
//             lambda = sigma + 1 / theta.
// Source:     Stewart, A Krylov-Schur algorithm for large eigenproblems, SIAM J. Matrix Anal. Appl. 23(3), 2001; Hernandez, Roman, Vidal,
//             SLEPc, ACM TOMS 31(3), 2005. Ericsson, Ruhe, Math. Comp. 35, 1980 (shift and invert).
// Deviations: none. Gram-Schmidt repeats as SLEPc decides: sparing its second pass lost orthogonality now and then.
#include "precompute/eigen/krylov.hpp"

#include <slepceps.h>

#include <algorithm>
#include <cmath>

#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

struct ShellContext {
  ShiftedFactor* factor = nullptr;
  std::int64_t solves = 0;
  double seconds = 0;
};

// C callbacks must not let exceptions through: they come back as PETSc errors with the same words.
PetscErrorCode apply_inverse(PC pc, Vec b, Vec x) {
  ShellContext* context = nullptr;
  PetscErrorCode code = PCShellGetContext(pc, &context);
  if (code != 0) return code;
  const double start = MPI_Wtime();
  try {
    context->factor->solve(b, x);
  } catch (const std::exception& error) {
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_LIB, "%s", error.what());
  }
  context->seconds += MPI_Wtime() - start;
  ++context->solves;
  return 0;
}

PetscErrorCode report_progress(EPS, PetscInt, PetscInt converged, PetscScalar*, PetscScalar*, PetscReal*, PetscInt, void* context) {
  static_cast<const KrylovRequest*>(context)->progress(converged);
  return 0;
}

// Error of lambda = sigma + 1 / theta relative to lambda, where that is more than the error of theta relative to theta: a mode near zero
// keeps its digits though the shift is far above it. Beyond kDigits the operator's own rounding would let nothing converge.
PetscErrorCode calc_error(EPS, PetscScalar theta, PetscScalar, PetscReal residual, PetscReal* error, void* context) {
  constexpr double kDigits = 1e3;
  const double sigma = static_cast<const KrylovRequest*>(context)->sigma;
  const double lambda = std::abs(sigma + 1 / theta);
  const double loss = std::min(std::abs(1 / theta) / std::max(lambda, PETSC_MACHINE_EPSILON), kDigits);
  *error = residual / std::abs(theta) * std::max(loss, 1.0);
  return 0;
}

}  // namespace

KrylovResult run_krylov_schur(const KrylovRequest& request) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(request.stiffness), &comm));
  PetscInt n = 0;
  check(MatGetSize(request.stiffness, &n, nullptr));
  petsc::EpsHandle eps;
  check(EPSCreate(comm, eps.out()));
  check(EPSSetOperators(eps, request.stiffness, request.mass));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetType(eps, EPSKRYLOVSCHUR));
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  check(EPSSetTarget(eps, request.sigma));

  ST st = nullptr;
  KSP ksp = nullptr;
  PC pc = nullptr;
  ShellContext shell{request.factor, 0, 0};
  check(EPSGetST(eps, &st));
  check(STSetType(st, STSINVERT));
  check(STSetShift(st, request.sigma));
  check(STSetMatMode(st, ST_MATMODE_SHELL));  // K - sigma M itself is formed where it is factorised.
  check(STGetKSP(st, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCSHELL));
  check(PCShellSetContext(pc, &shell));
  check(PCShellSetApply(pc, apply_inverse));

  const auto deflated = static_cast<PetscInt>(request.deflated.size());
  const PetscInt room = n - deflated;
  const PetscInt wanted = std::min(request.wanted, room);
  // A basis of this size converges without a restart, as a rule; a restart throws away half of its solves. A shift within the band has the
  // modes on both sides of it and needs less.
  const PetscInt ncv = std::min(room, wanted + (request.sigma > 0 ? wanted / 2 : wanted) + 30);
  check(EPSSetDimensions(eps, wanted, ncv, ncv));
  check(EPSSetTolerances(eps, request.tolerance, 200));
  check(EPSSetConvergenceTestFunction(eps, calc_error, const_cast<KrylovRequest*>(&request), nullptr));
  check(EPSSetPurify(eps, PETSC_FALSE));
  if (deflated > 0) check(EPSSetDeflationSpace(eps, deflated, const_cast<Vec*>(request.deflated.data())));
  if (request.progress) check(EPSMonitorSet(eps, report_progress, const_cast<KrylovRequest*>(&request), nullptr));

  check(EPSSolve(eps));

  KrylovResult result;
  result.solves = shell.solves;
  result.solve_seconds = shell.seconds;
  PetscInt converged = 0;
  check(EPSGetConverged(eps, &converged));
  for (PetscInt i = 0; i < converged; ++i) {
    petsc::VecHandle vector;
    PetscScalar lambda = 0;
    check(MatCreateVecs(request.stiffness, vector.out(), nullptr));
    check(EPSGetEigenpair(eps, i, &lambda, nullptr, vector, nullptr));
    result.pairs.lambda.push_back(lambda);
    result.pairs.vectors.push_back(std::move(vector));
  }
  return result;
}

}  // namespace carillon::eigen

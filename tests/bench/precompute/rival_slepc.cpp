// Plain SLEPc: EPS with its default solver (Krylov-Schur) and default subspace, shift-invert by MUMPS with its defaults, or by CHOLMOD;
// eigenvectors are not purified. All options of SLEPc and PETSc may follow the arguments (-eps_mpd 100, -st_mat_mumps_icntl_7 2, ...).
#include <fmt/core.h>
#include <slepceps.h>

#include <cstring>

#include "tests/bench/precompute/system_file.hpp"

namespace {

void check(PetscErrorCode code) { bench::demand(code == 0, fmt::format("PETSc error {}", static_cast<int>(code))); }

PetscErrorCode end_orthogonalise(KSP, Vec, Vec, void* phases) {
  static_cast<bench::Phases*>(phases)->end("orthogonalise");
  return 0;
}
PetscErrorCode end_solve(KSP, Vec, Vec, void* phases) {
  static_cast<bench::Phases*>(phases)->end("solve");
  return 0;
}

void run(const bench::Arguments& arguments, bool is_cholmod) {
  bench::Phases phases;
  bench::Matrix stiffness = bench::read_matrix(arguments.stiffness);
  bench::Matrix mass = bench::read_matrix(arguments.mass);
  const auto n = static_cast<PetscInt>(stiffness.n);
  Mat k = nullptr, m = nullptr;
  check(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, n, n, stiffness.first.data(), stiffness.column.data(), stiffness.value.data(), &k));
  check(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, n, n, mass.first.data(), mass.column.data(), mass.value.data(), &m));
  for (Mat matrix : {k, m}) check(MatSetOption(matrix, MAT_SYMMETRIC, PETSC_TRUE));
  phases.end("read");

  EPS eps = nullptr;
  check(EPSCreate(PETSC_COMM_SELF, &eps));
  check(EPSSetOperators(eps, k, m));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  check(EPSSetTarget(eps, arguments.sigma));
  check(EPSSetDimensions(eps, arguments.modes, PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, arguments.tolerance, 1000));
  // In its favour: by default SLEPc solves once more per eigenvector, which only a singular M requires.
  check(EPSSetPurify(eps, PETSC_FALSE));
  ST st = nullptr;
  KSP ksp = nullptr;
  PC pc = nullptr;
  check(EPSGetST(eps, &st));
  check(STSetType(st, STSINVERT));
  check(STSetMatStructure(st, SUBSET_NONZERO_PATTERN));
  check(STGetKSP(st, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCCHOLESKY));
  check(PCFactorSetMatSolverType(pc, is_cholmod ? MATSOLVERCHOLMOD : MATSOLVERMUMPS));
  check(EPSSetFromOptions(eps));
  check(EPSSetUp(eps));
  phases.end("factor");

  check(KSPSetPreSolve(ksp, end_orthogonalise, &phases));
  check(KSPSetPostSolve(ksp, end_solve, &phases));
  check(EPSSolve(eps));
  PetscInt found = 0;
  check(EPSGetConverged(eps, &found));
  bench::demand(found >= arguments.modes, fmt::format("{} of {} converged", found, arguments.modes));
  std::vector<double> lambda(arguments.modes), vectors(static_cast<std::size_t>(n) * arguments.modes);
  for (PetscInt i = 0; i < arguments.modes; ++i) {
    Vec x = nullptr;
    check(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, n, vectors.data() + static_cast<std::size_t>(i) * n, &x));
    check(EPSGetEigenpair(eps, i, &lambda[i], nullptr, x, nullptr));
    check(VecDestroy(&x));
  }
  phases.end("orthogonalise");
  bench::write_answer(arguments.answer, n, lambda, vectors.data());
  phases.end("write");
  PetscInt solves = 0;
  check(KSPGetTotalIterations(ksp, &solves));
  phases.count("solves", static_cast<double>(solves));
  phases.write(arguments.phases);
  check(EPSDestroy(&eps));
  check(MatDestroy(&k));
  check(MatDestroy(&m));
}

}  // namespace

int main(int argc, char** argv) {
  if (SlepcInitialize(&argc, &argv, nullptr, nullptr) != 0) return 4;
  int code = 0;
  try {
    run(bench::parse_arguments(argc, argv), argc > 8 && std::strcmp(argv[8], "cholmod") == 0);
  } catch (const std::exception& error) {
    fmt::print(stderr, "rival_slepc: {}\n", error.what());
    code = 3;
  }
  SlepcFinalize();
  return code;
}

// Block Lanczos as a type of SLEPc's eigensolver object.
#pragma once

#include <slepceps.h>

#include "precompute/eigen/lanczos_checkpoint.hpp"
#include "precompute/eigen/locked_modes.hpp"

namespace carillon::eigen {

/// The name for EPSSetType and -eps_type.
inline constexpr const char* kBlockLanczosType = "blocklanczos";

/// Makes the type known to SLEPc; may be called again. Call after SlepcInitialize.
///
/// For EPS_HEP and EPS_GHEP. With EPS_ALL it seeks the eigenvalues of the interval (EPSSetInterval), nev says how many there are (a guess
/// after set_count_known); it stops when it has them, or when everything it sees in the interval and something beyond it has converged:
/// copies of repeated eigenvalues that are still missing need another run with these deflated. Otherwise it seeks the nev wanted ones. It
/// heeds ncv (size of the basis; a full one is restarted with its best Ritz vectors), tol, max_it (in blocks), the convergence and stopping
/// tests, monitors, the deflation and the initial space, and -eps_blocklanczos_block_size. Errors are PETSc's. Collective.
PetscErrorCode register_block_lanczos();

/// Columns per block; PETSC_DEFAULT: 16. Logically collective.
PetscErrorCode set_block_size(EPS eps, PetscInt columns);

/// Whether nev is the number of eigenvalues in the interval (as it is at first) or a guess, which does not end the iteration. Logically
/// collective.
PetscErrorCode set_count_known(EPS eps, PetscBool known);

/// Modes that the iteration stays orthogonal to, in addition to the deflation space. They are taken as they are, which is what makes
/// hundreds of them cheap (EPSSetDeflationSpace orthonormalises again, vector by vector), and their parts in a step are predicted
/// (orthogonality.hpp). Must outlive the solve; null: none. Logically collective.
PetscErrorCode set_locked(EPS eps, const LockedModes* locked);

/// The own rows' diagonal of a mass matrix that has nothing else, on every rank or on none: its products are made while others are. Must
/// outlive the solve; null: not known. Logically collective.
PetscErrorCode set_mass_diagonal(EPS eps, const double* diagonal);

/// Null: none. Must outlive the solve. Logically collective.
PetscErrorCode set_checkpoint(EPS eps, LanczosCheckpoint* checkpoint);

}  // namespace carillon::eigen

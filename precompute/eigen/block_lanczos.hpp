// Block Lanczos with shift and invert, as a type of SLEPc's eigensolver object.
#pragma once

#include <mpi.h>
#include <slepceps.h>

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "precompute/eigen/block_kernels.hpp"
#include "precompute/eigen/checkpoint.hpp"
#include "precompute/eigen/orthogonality.hpp"

namespace carillon::eigen {

/// The name for EPSSetType and -eps_type.
inline constexpr const char* kBlockLanczosType = "blocklanczos";

/// Makes the type known to SLEPc; again and again does no harm. Call after SlepcInitialize.
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

/// Eigenvectors that are known, beside the deflation space: M-orthonormal columns of this rank's rows, and their eigenvalues.
struct LockedModes {
  std::vector<Columns> sets;   // somebody else's
  std::vector<double> lambda;  // of all columns, set by set

  int count() const { return static_cast<int>(lambda.size()); }
  /// L^T B of all ranks for a range of columns of L, (range.count, b.count). Collective.
  std::vector<double> multiply_transposed(MPI_Comm comm, LockedRange range, const Columns& b) const;
  /// B <- B - L S for that range, S: (range.count, b.count). Local.
  void subtract_product(LockedRange range, const std::vector<double>& s, const Columns& b) const;

 private:
  template <class Visit>
  void for_parts(LockedRange range, const Visit& visit) const;
};

/// Modes that the iteration stays orthogonal to. They are taken as they are, which is what makes hundreds of them cheap
/// (EPSSetDeflationSpace orthonormalises anew, vector by vector), and what they weigh in a step is predicted (orthogonality.hpp). Must
/// outlive the solve; null: none. Logically collective.
PetscErrorCode set_locked(EPS eps, const LockedModes* locked);

/// Where an iteration stands between two steps, beside its basis. The same on every rank.
struct LanczosState {
  /// block, room, size, width, previous, next_check, last_size, last_converged, iterations, noise: as the iteration calls them.
  std::array<std::int64_t, 10> sizes{};
  std::vector<double> t;  // (size, size) the projected operator

  std::int64_t size() const { return sizes[2]; }
};

/// Saves an iteration on its way, and resumes one.
struct LanczosKeeper {
  std::function<Wish()> ask;                                            // local, every step
  std::function<void(const LanczosState&, const Columns& basis)> save;  // collective
  const LanczosState* start = nullptr;                                  // null: from the beginning
  std::function<void(const Columns& basis)> read;                       // of start; collective
  std::function<void(const std::string& why)> reject;                   // start does not fit; collective
  bool was_stopped = false;                                             // it ended because ask() wished so, after save()
};

/// Null: none. The keeper must outlive the solve. Logically collective.
PetscErrorCode set_keeper(EPS eps, LanczosKeeper* keeper);

}  // namespace carillon::eigen

// MPI, PETSc and SLEPc for the life of a program; their errors as exceptions.
#pragma once

#include <mpi.h>
#include <petscsys.h>

#include <cstdint>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::petsc {

/// Starts MPI, PETSc and SLEPc, and ends them. One per program, made first in main and destroyed last.
///
/// PETSc reads no option from PETSC_OPTIONS or from its files, takes of the command line what it is handed here ("-eps_monitor",
/// "-eps_tol", "1e-9"), and installs no signal handlers: what a run does is in its job file and these words alone. PETSc's errors are
/// recorded instead of printed; check() turns them into exceptions. Throws SystemError when MPI or PETSc does not start.
class Session {
 public:
  Session(int& argc, char**& argv, const std::vector<std::string>& petsc_options = {});
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  int rank() const { return rank_; }
  int size() const { return size_; }

 private:
  int rank_ = 0;
  int size_ = 1;
  bool started_mpi_ = false;
};

/// Names of options that were not used so far: misspelt ones, at the end of a run. Local; the same on every rank.
std::vector<std::string> find_unused_options();

/// Throws if a PETSc or SLEPc call failed: SystemError for memory, file and library failures, SolveError for everything else, with PETSc's
/// own words. Local: the other ranks do not know, so use it where an error is a defect or hits every rank alike.
void check(PetscErrorCode code);

/// The ranks of a Mat, Vec or another object of PETSc's.
comm::Communicator get_communicator(PetscObject object);
template <typename Struct>
comm::Communicator get_communicator(Struct* object) {
  return get_communicator(reinterpret_cast<PetscObject>(object));
}

/// Narrows a count to PETSc's (32-bit) index type. Throws SystemError when it does not fit.
PetscInt to_petsc_int(std::int64_t value);

/// Gives the memory of the whole pages between two addresses back to the system; what is read there afterwards is zero. Local.
void give_back_pages(void* begin, void* end);

/// The BLAS behind dgemm in this process, and why it has the kernels that it has: "OpenBLAS 0.3.21 ... (/usr/lib/...), kernels SkylakeX,
/// OpenBLAS's own choice", "reference BLAS (/usr/lib/...)". Local.
std::string blas_name();
/// True if it is the unoptimised reference BLAS (in DGEMM about 14 times slower than OpenBLAS on one core).
bool blas_is_reference();
/// A warning where OpenBLAS runs kernels without the vector instructions of this processor (AVX2 on), two to eight times slower in what the
/// BLAS does, with the correction; empty where there is nothing to say. Local.
std::string describe_slow_kernels();

/// Has OpenBLAS take its working memory (128 MB of address space) now: later, when there is none left, it retries without end instead of
/// failing. Collective. Throws SystemError on every rank where there is not so much.
void reserve_blas_memory(MPI_Comm comm);

/// "PETSc 3.18.5", "SLEPc 3.18.2", "Open MPI v4.1.4".
std::string petsc_version();
std::string slepc_version();
std::string mpi_version();

}  // namespace carillon::petsc

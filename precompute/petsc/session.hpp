// Lifetime of MPI, PETSc and SLEPc in a program; their errors as exceptions.
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

/// Starts MPI, PETSc and SLEPc, and ends them. One per program, constructed first in main and destroyed last.
///
/// PETSc reads no options from PETSC_OPTIONS or its files, only those passed here ("-log_view"), and installs no signal handlers: a run
/// depends on its job file and these options only. PETSc errors are recorded instead of printed; check() converts them to exceptions.
/// Throws SystemError if MPI or PETSc does not start.
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

/// Names of options not used so far; at the end of a run these are misspelt. Local; the same on every rank.
std::vector<std::string> find_unused_options();

/// Throws if a PETSc or SLEPc call failed: SystemError for memory, file and library failures, SolveError for other errors, with the message
/// of PETSc. Local: use it for defects or errors that occur on all ranks alike.
void check(PetscErrorCode code);

/// Communicator of a Mat, Vec or other PETSc object.
comm::Communicator get_communicator(PetscObject object);
template <typename Struct>
comm::Communicator get_communicator(Struct* object) {
  return get_communicator(reinterpret_cast<PetscObject>(object));
}

/// Narrows a count to the (32-bit) index type of PETSc. Throws SystemError if it does not fit.
PetscInt to_petsc_int(std::int64_t value);

/// Returns the memory of whole pages between two addresses to the system; they then read as zero. Local.
void give_back_pages(void* begin, void* end);

/// The BLAS that provides dgemm in this process, and the reason for its kernels: "OpenBLAS 0.3.21 ... (/usr/lib/...), kernels SkylakeX,
/// OpenBLAS's own choice", "reference BLAS (/usr/lib/...)". Local.
std::string blas_name();
/// True for the unoptimised reference BLAS (DGEMM about 14 times slower than OpenBLAS on one core).
bool blas_is_reference();
/// Warning if OpenBLAS runs kernels without the vector instructions of this processor (AVX2 or later), two to eight times slower, with a
/// remedy; empty if none is needed. Local.
std::string describe_slow_kernels();

/// Makes OpenBLAS allocate its working memory (128 MB of address space) now: if allocation fails later, it retries forever. Collective.
/// Throws SystemError on every rank if memory does not suffice.
void reserve_blas_memory(MPI_Comm comm);

/// "PETSc 3.18.5", "SLEPc 3.18.2", "Open MPI v4.1.4".
std::string petsc_version();
std::string slepc_version();
std::string mpi_version();

}  // namespace carillon::petsc

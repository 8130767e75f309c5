// MPI, PETSc and SLEPc for the life of a program; their errors as exceptions; agreement between ranks.
#pragma once

#include <mpi.h>
#include <petscsys.h>

#include <cstdint>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

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

/// True on every rank if `ok` was true on every rank. Collective.
bool all_ok(MPI_Comm comm, bool ok);

/// Throws InputError(text) on every rank if any rank brings a non-empty text; the lowest such rank's text wins. Collective.
void agree(MPI_Comm comm, const std::string& error_text);

/// The same for an exception caught on some ranks (null: none): the lowest such rank's InputError, SolveError or SystemError is thrown on
/// every rank; any other exception arrives as SystemError. Collective.
void agree(MPI_Comm comm, std::exception_ptr error);

/// Runs `work` on every rank, then agrees: either all ranks return or all throw the same. `work` must not itself be collective unless it
/// throws on all ranks alike. Collective.
template <typename Work>
void run_agreed(MPI_Comm comm, Work&& work) {
  std::exception_ptr error;
  try {
    work();
  } catch (...) {
    error = std::current_exception();
  }
  agree(comm, error);
}

/// Narrows a count to PETSc's (32-bit) index type. Throws SystemError when it does not fit.
PetscInt to_petsc_int(std::int64_t value);

/// Gives the memory of the whole pages between two addresses back to the system; what is read there afterwards is zero. Local.
void give_back_pages(void* begin, void* end);

/// Starts the program again, once, with OPENBLAS_CORETYPE set, when OpenBLAS took kernels for older instructions than this processor has:
/// its releases know the processors of their day by number, and every later one is a Pentium 4 to them. Call it first in main, before MPI
/// starts; returns where nothing is to be corrected: the kernels fit, the user has set OPENBLAS_CORETYPE, or the BLAS is another. Local.
void restart_with_fitting_kernels(char** argv);
/// The BLAS behind dgemm in this process, and why it has the kernels that it has: "OpenBLAS 0.3.21 ... (/usr/lib/...), kernels SkylakeX,
/// OpenBLAS's own choice", "reference BLAS (/usr/lib/...)". Local.
std::string blas_name();
/// True if it is the unoptimised reference BLAS (in DGEMM about 14 times slower than OpenBLAS on one core).
bool blas_is_reference();
/// One BLAS thread and one OpenMP thread per rank: the panels of the factor are too small for more, and spinning threads slow other ranks.
void pin_blas_threads();

/// Has OpenBLAS take its working memory (128 MB of address space) now: later, when there is none left, it asks for it for ever instead of
/// failing. Collective. Throws SystemError on every rank where there is not so much.
void reserve_blas_memory(MPI_Comm comm);

/// "PETSc 3.18.5", "SLEPc 3.18.2", "Open MPI v4.1.4".
std::string petsc_version();
std::string slepc_version();
std::string mpi_version();

}  // namespace carillon::petsc

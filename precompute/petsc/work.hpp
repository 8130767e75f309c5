// What a run does, in numbers that do not depend on the machine's mood: operations, messages, bytes.
#pragma once

#include <mpi.h>

#include <array>
#include <cstddef>

namespace carillon::petsc {

/// Of one rank or summed over all.
struct Work {
  double flops = 0;             // floating-point operations of the factorisation, the solves, products of blocks, and what PETSc counts
  double messages = 0;          // sent from one rank to another
  double bytes = 0;             // in them
  double collectives = 0;       // calls in which many ranks take part, counted on each
  double collective_bytes = 0;  // what the ranks put into them
};

enum class WorkPhase { kOther, kRead, kPartition, kAssemble, kFactor, kSolve, kOrthogonalise, kErrors, kWrite };
inline constexpr std::size_t kWorkPhases = 9;
inline constexpr std::array<const char*, kWorkPhases> kWorkPhaseNames{"other", "read",          "partition", "assemble", "factor",
                                                                      "solve", "orthogonalise", "errors",    "write"};

/// What follows on this process belongs to the phase. Returns the one before.
WorkPhase set_work_phase(WorkPhase phase);

/// Sets the phase for the time of its life.
class WorkScope {
 public:
  explicit WorkScope(WorkPhase phase) : before_(set_work_phase(phase)) {}
  ~WorkScope() { set_work_phase(before_); }
  WorkScope(const WorkScope&) = delete;
  WorkScope& operator=(const WorkScope&) = delete;

 private:
  WorkPhase before_;
};

/// Operations of this process that PETSc does not know of.
void add_flops(double flops);

/// Of this process so far, by phase. Messages are counted where the program calls MPI, through its profiling interface: calls from Fortran
/// (MUMPS) and on several threads are not seen. Local.
std::array<Work, kWorkPhases> find_work();

/// The same of all ranks together, on every rank. Collective.
std::array<Work, kWorkPhases> sum_work(MPI_Comm comm);

}  // namespace carillon::petsc

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

/// What it took, which does depend on the machine's mood. Seconds summed over the ranks, where there are several.
struct Effort {
  double cpu_seconds = 0;  // user and system
  double wall_seconds = 0;
  double mpi_seconds = 0;  // of wall_seconds: inside MPI, transfers and waiting for others
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

struct PhaseWork {
  Work work;
  Effort effort;
};
using WorkTable = std::array<PhaseWork, kWorkPhases>;

/// Of this process so far, by phase. Messages are counted where the program calls MPI, through its profiling interface: calls from Fortran
/// (MUMPS) and on several threads are not seen. Local.
WorkTable find_work();

/// The same of all ranks together, on every rank. Collective.
WorkTable sum_work(MPI_Comm comm);

}  // namespace carillon::petsc

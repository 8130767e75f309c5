// What a run does, in numbers that do not depend on the machine's load: operations, messages, bytes; and in seconds.
#pragma once

#include <mpi.h>

#include <array>
#include <cstddef>

#include "precompute/comm/communicator.hpp"

namespace carillon::petsc {

/// Do we know the messages of this run? Only under the profiling library (precompute/petsc/profile): carillon-precompute --profile.
bool is_profiled();

/// Of one rank or summed over all. Messages and collectives are 0 where they are not counted.
struct Work {
  double flops = 0;             // floating-point operations of the factorisation, the solves, products of blocks, and what PETSc counts
  double messages = 0;          // sent from one rank to another
  double bytes = 0;             // in them
  double collectives = 0;       // calls in which many ranks take part, counted on each
  double collective_bytes = 0;  // what the ranks put into them
};

/// Seconds, summed over the ranks where there are several.
struct Effort {
  double cpu_seconds = 0;  // user and system
  double wall_seconds = 0;
  double mpi_seconds = 0;  // of wall_seconds: inside MPI, transfers and waiting; 0 where it is not measured
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

/// Adds operations that PETSc does not count.
void add_flops(double flops);

struct PhaseWork {
  Work work;
  Effort effort;
};
using WorkTable = std::array<PhaseWork, kWorkPhases>;

/// Of this process so far, by phase. Local.
WorkTable find_work();

/// The same of all ranks together, on every rank. Collective.
WorkTable sum_work(const comm::Communicator& comm);

}  // namespace carillon::petsc

// Work of a run: operations, messages, bytes, which do not depend on the machine's load; and seconds.
#pragma once

#include <mpi.h>

#include <array>
#include <cstddef>

#include "precompute/comm/communicator.hpp"

namespace carillon::petsc {

/// True if messages are counted: with the profiling library (precompute/petsc/profile), carillon-precompute --profile.
bool is_profiled();

/// For one rank or summed over all. Messages and collectives are 0 if not counted.
struct Work {
  double flops = 0;             // floating-point operations of the factorisation, solves, block products, and those counted by PETSc
  double messages = 0;          // point-to-point sends
  double bytes = 0;             // bytes of those
  double collectives = 0;       // collective calls, counted on each rank
  double collective_bytes = 0;  // bytes contributed by the ranks
};

/// Seconds, summed over the ranks if several.
struct Effort {
  double cpu_seconds = 0;  // user and system
  double wall_seconds = 0;
  double mpi_seconds = 0;  // part of wall_seconds inside MPI, transfers and waiting; 0 if not measured
};

enum class WorkPhase { kOther, kRead, kPartition, kAssemble, kFactor, kSolve, kOrthogonalise, kErrors, kAir, kCoupling, kWrite };
inline constexpr std::size_t kWorkPhases = 11;
inline constexpr std::array<const char*, kWorkPhases> kWorkPhaseNames{"other",         "read",   "partition", "assemble", "factor", "solve",
                                                                      "orthogonalise", "errors", "air",       "coupling", "write"};

/// Assigns subsequent work of this process to a phase. Returns the previous one.
WorkPhase set_work_phase(WorkPhase phase);

/// Sets the phase for its lifetime.
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

/// Work of this process so far, by phase. Local.
WorkTable find_work();

/// Sum over all ranks, on every rank. Collective.
WorkTable sum_work(const comm::Communicator& comm);

}  // namespace carillon::petsc

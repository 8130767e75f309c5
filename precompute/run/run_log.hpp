// Log of a run: progress lines, time and memory of each phase.
#pragma once

#include <mpi.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/petsc/work.hpp"

namespace carillon::run {

/// A finished phase.
struct RunPhase {
  std::string name;
  double seconds = 0.0;             // wall clock of the slowest rank
  double cpu_seconds = 0.0;         // user and system, all ranks together
  std::int64_t peak_bytes = 0;      // up to now, largest rank
  std::int64_t peak_sum_bytes = 0;  // up to now, sum over ranks
};

/// Prints progress lines on rank 0 and times the phases.
class RunLog {
 public:
  /// quiet: prints nothing.
  RunLog(const comm::Communicator& comm, bool quiet);

  /// Called at the start of every phase, on rank 0.
  void set_listener(std::function<void(const std::string& name)> listener) { listener_ = std::move(listener); }
  /// Starts a phase; `what`: its input. Not collective.
  void begin(const std::string& name, const std::string& what);
  /// Prints one or several lines in the phase, on rank 0. Not collective.
  void print(const std::string& text) const;
  /// Prints a warning to standard error, on rank 0, and records it. Not collective.
  void warn(const std::string& text);
  /// The same, skipping repetitions.
  void warn_once(const std::string& text);
  /// Ends the phase and prints its seconds and memory. Collective.
  const RunPhase& end();

  const std::vector<RunPhase>& get_phases() const { return phases_; }
  const std::vector<std::string>& get_warnings() const { return warnings_; }

 private:
  comm::Communicator comm_;
  bool prints_ = false;
  std::string name_;
  std::chrono::steady_clock::time_point start_;
  double start_cpu_s_ = 0.0;
  std::vector<RunPhase> phases_;
  std::vector<std::string> warnings_;
  std::function<void(const std::string& name)> listener_;
};

/// Peak bytes of every rank, on rank 0; empty on the others. Collective.
std::vector<std::int64_t> gather_peak_bytes(const comm::Communicator& comm);

/// Resources used so far.
struct Measured {
  std::vector<std::int64_t> peak_bytes;  // of each rank; on rank 0
  petsc::WorkTable work{};               // of all ranks
};

/// Collective.
Measured measure(const comm::Communicator& comm);

/// Commit of this build, "-dirty" if tracked files differ from it; "unknown" outside git.
std::string git_id();

/// Name and version of the libraries at run time, as (name, version) pairs: PETSc, SLEPc, METIS, HDF5, Open MPI, BLAS.
/// The factorisation's library and version are part of the solver's statistics.
std::vector<std::pair<std::string, std::string>> find_versions();

/// The host's time in UTC as ISO 8601, "2002-07-21T10:00:00Z".
std::string find_time_utc();

}  // namespace carillon::run

// The log of a run: its progress lines, and time and memory of each phase.
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

/// One finished phase of the run.
struct RunPhase {
  std::string name;
  double seconds = 0.0;             // wall clock of the slowest rank
  double cpu_seconds = 0.0;         // user and system, all ranks together
  std::int64_t peak_bytes = 0;      // so far, of the rank that used most
  std::int64_t peak_sum_bytes = 0;  // so far, of all ranks together
};

/// Prints progress lines on rank 0 and times the phases.
class RunLog {
 public:
  /// quiet: nothing is printed.
  RunLog(const comm::Communicator& comm, bool quiet);

  /// Called at the start of every phase, on rank 0.
  void set_listener(std::function<void(const std::string& name)> listener) { listener_ = std::move(listener); }
  /// Starts a phase; `what` says what it works on. Not collective.
  void begin(const std::string& name, const std::string& what);
  /// Prints a line, or several, inside the phase, on rank 0. Not collective.
  void print(const std::string& text) const;
  /// Prints a warning to standard error, on rank 0, and keeps it for the record. Not collective.
  void warn(const std::string& text);
  /// The same without repetitions, for a body meshed several times.
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

/// The same of every rank, on rank 0; empty on the others. Collective.
std::vector<std::int64_t> gather_peak_bytes(const comm::Communicator& comm);

/// What a run has taken and done so far.
struct Measured {
  std::vector<std::int64_t> peak_bytes;  // of each rank; on rank 0
  petsc::WorkTable work{};               // of all ranks
};

/// Collective.
Measured measure(const comm::Communicator& comm);

/// The commit that this build was made from, "-dirty" appended when tracked files differ from it; "unknown" outside git.
std::string git_id();

/// Name and version of the libraries at run time, as (name, version) pairs: PETSc, SLEPc, METIS, HDF5, Open MPI, BLAS.
/// The factorisation's library and version are part of the solver's statistics.
std::vector<std::pair<std::string, std::string>> find_versions();

/// The host's time in UTC as ISO 8601, "2002-07-21T10:00:00Z".
std::string find_time_utc();

}  // namespace carillon::run

// The record of a run: what each station took, on which libraries, on how many ranks.
#pragma once

#include <mpi.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace carillon::io {

/// One finished station of the run: the slowest rank's seconds, the largest rank's peak memory up to its end.
struct Station {
  std::string name;
  double seconds = 0.0;
  std::int64_t peak_bytes = 0;      // of the rank that used most
  std::int64_t peak_sum_bytes = 0;  // of all ranks together
};

/// Prints progress lines on rank 0 and times the stations.
class Stations {
 public:
  /// quiet: nothing is printed.
  Stations(MPI_Comm comm, bool quiet);

  /// Starts a station; `what` says what it works on. Not collective.
  void begin(const std::string& name, const std::string& what);
  /// Prints a line inside the station, on rank 0. Not collective.
  void say(const std::string& text) const;
  /// Ends the station and prints its seconds and memory. Collective.
  const Station& end();

  const std::vector<Station>& get_all() const { return stations_; }

 private:
  MPI_Comm comm_;
  bool speaks_ = false;
  std::string name_;
  std::chrono::steady_clock::time_point start_;
  std::vector<Station> stations_;
};

/// The commit that this build was made from, "-dirty" appended when tracked files differ from it; "unknown" outside git.
std::string git_id();

/// Name and version of the libraries at run time, as (name, version) pairs: PETSc, SLEPc, METIS, HDF5, Open MPI, BLAS.
/// The factorisation's library and version are part of the solver's statistics.
std::vector<std::pair<std::string, std::string>> find_versions();

/// The host's time in UTC as ISO 8601, "2002-07-21T10:00:00Z".
std::string find_time_utc();

}  // namespace carillon::io

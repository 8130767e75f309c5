#include "precompute/io/run_record.hpp"

#include <fmt/core.h>
#include <hdf5.h>

#include <array>
#include <cstdio>
#include <ctime>
#include <utility>

#include "partition/partition.hpp"
#include "precompute/io/git_id.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::io {
namespace {

/// "PETSc 3.18.5" without its first word or words: the version alone.
std::string strip_name(const std::string& text) {
  const auto digit = text.find_first_of("0123456789");
  return digit == std::string::npos ? text : text.substr(digit);
}

}  // namespace

Stations::Stations(MPI_Comm comm, bool quiet) : comm_(comm) {
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  speaks_ = rank == 0 && !quiet;
}

void Stations::begin(const std::string& name, const std::string& what) {
  name_ = name;
  start_ = std::chrono::steady_clock::now();
  if (!speaks_) return;
  fmt::print("{:<10} {}\n", name, what);
  std::fflush(stdout);
}

void Stations::say(const std::string& text) const {
  if (!speaks_) return;
  fmt::print("           {}\n", text);
  std::fflush(stdout);
}

const Station& Stations::end() {
  Station station;
  station.name = name_;
  station.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  MPI_Allreduce(MPI_IN_PLACE, &station.seconds, 1, MPI_DOUBLE, MPI_MAX, comm_);
  const petsc::PeakMemory memory = petsc::find_peak_memory(comm_);
  station.peak_bytes = memory.max_bytes;
  station.peak_sum_bytes = memory.sum_bytes;
  stations_.push_back(station);
  say(fmt::format("{:.2f} s, {:.0f} MB peak on the largest rank", station.seconds, station.peak_bytes / 1e6));
  return stations_.back();
}

std::string git_id() { return kGitId; }

std::vector<std::pair<std::string, std::string>> find_versions() {
  std::array<unsigned, 3> hdf5{};
  H5get_libversion(&hdf5[0], &hdf5[1], &hdf5[2]);
  return {{"petsc", strip_name(petsc::petsc_version())},
          {"slepc", strip_name(petsc::slepc_version())},
          {"metis", partition::metis_version()},
          {"hdf5", fmt::format("{}.{}.{}", hdf5[0], hdf5[1], hdf5[2])},
          {"mpi", petsc::mpi_version()},
          {"blas", petsc::blas_name()}};
}

std::string find_time_utc() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text.data();
}

}  // namespace carillon::io

#include "precompute/io/run_record.hpp"

#include <fmt/core.h>
#include <hdf5.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <sstream>
#include <utility>

#include "partition/partition.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/cpu_clock.hpp"
#include "runtime/base/host.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/version/version.hpp"

namespace carillon::io {
namespace {

/// "PETSc 3.18.5" without its first word or words: the version alone.
std::string strip_name(const std::string& text) {
  const auto digit = text.find_first_of("0123456789");
  return digit == std::string::npos ? text : text.substr(digit);
}

}  // namespace

namespace {

/// What is done in a station, where nothing says otherwise.
petsc::WorkPhase find_work_phase(const std::string& station) {
  if (station == "read") return petsc::WorkPhase::kRead;
  if (station == "partition") return petsc::WorkPhase::kPartition;
  if (station == "assemble") return petsc::WorkPhase::kAssemble;
  if (station == "modes") return petsc::WorkPhase::kOrthogonalise;
  if (station == "errors") return petsc::WorkPhase::kErrors;
  return petsc::WorkPhase::kWrite;
}

}  // namespace

Stations::Stations(MPI_Comm comm, bool quiet) : comm_(comm) {
  MPI_Comm_rank(comm, &rank_);
  speaks_ = rank_ == 0 && !quiet;
}

void Stations::begin(const std::string& name, const std::string& what) {
  name_ = name;
  petsc::set_work_phase(find_work_phase(name));
  start_ = std::chrono::steady_clock::now();
  start_cpu_s_ = base::get_process_cpu_s();
  if (listener_) listener_(name);
  if (!speaks_) return;
  fmt::print("{:<10} {}\n", name, base::printable(what));
  std::fflush(stdout);
}

void Stations::say(const std::string& text) const {
  if (!speaks_) return;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) fmt::print("           {}\n", base::printable(line));
  std::fflush(stdout);
}

void Stations::warn(const std::string& text) {
  if (rank_ != 0) return;
  warnings_.push_back(text);
  std::fflush(stdout);
  fmt::print(stderr, "carillon-precompute: warning: {}\n", base::printable(text));
}

const Station& Stations::end() {
  Station station;
  station.name = name_;
  station.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  station.cpu_seconds = base::get_process_cpu_s() - start_cpu_s_;
  station.peak_bytes = station.peak_sum_bytes = base::find_memory().peak;
  MPI_Allreduce(MPI_IN_PLACE, &station.seconds, 1, MPI_DOUBLE, MPI_MAX, comm_);
  MPI_Allreduce(MPI_IN_PLACE, &station.cpu_seconds, 1, MPI_DOUBLE, MPI_SUM, comm_);
  MPI_Allreduce(MPI_IN_PLACE, &station.peak_bytes, 1, MPI_INT64_T, MPI_MAX, comm_);
  MPI_Allreduce(MPI_IN_PLACE, &station.peak_sum_bytes, 1, MPI_INT64_T, MPI_SUM, comm_);
  petsc::set_work_phase(petsc::WorkPhase::kOther);
  stations_.push_back(station);
  say(fmt::format("{:.2f} s, {:.0f} MB peak on the largest rank", station.seconds, station.peak_bytes / 1e6));
  return stations_.back();
}

std::vector<std::int64_t> gather_peak_bytes(MPI_Comm comm) {
  int rank = 0, ranks = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &ranks);
  const std::int64_t mine = base::find_memory().peak;
  std::vector<std::int64_t> all(rank == 0 ? static_cast<std::size_t>(ranks) : 0);
  MPI_Gather(&mine, 1, MPI_INT64_T, all.data(), 1, MPI_INT64_T, 0, comm);
  return all;
}

Measured measure(MPI_Comm comm) {
  Measured measured;
  measured.peak_bytes = gather_peak_bytes(comm);
  measured.work = petsc::sum_work(comm);
  return measured;
}

std::string git_id() { return version::get_git_id(); }

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

#include "precompute/run/run_log.hpp"

#include <fmt/core.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <sstream>
#include <utility>

#include "partition/partition.hpp"
#include "precompute/comm/exchange.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/host.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/version.hpp"

namespace carillon::run {
namespace {

/// "PETSc 3.18.5" -> "3.18.5".
std::string strip_name(const std::string& text) {
  const auto digit = text.find_first_of("0123456789");
  return digit == std::string::npos ? text : text.substr(digit);
}

}  // namespace

namespace {

/// Default work phase of a run phase.
petsc::WorkPhase find_work_phase(const std::string& phase) {
  if (phase == "read") return petsc::WorkPhase::kRead;
  if (phase == "partition") return petsc::WorkPhase::kPartition;
  if (phase == "assemble") return petsc::WorkPhase::kAssemble;
  if (phase == "modes") return petsc::WorkPhase::kOrthogonalise;
  if (phase == "errors") return petsc::WorkPhase::kErrors;
  if (phase == "air") return petsc::WorkPhase::kAir;
  if (phase == "coupling") return petsc::WorkPhase::kCoupling;
  return petsc::WorkPhase::kWrite;
}

}  // namespace

RunLog::RunLog(const comm::Communicator& comm, bool quiet) : comm_(comm), prints_(comm.is_root() && !quiet) {}

void RunLog::begin(const std::string& name, const std::string& what) {
  name_ = name;
  petsc::set_work_phase(find_work_phase(name));
  start_ = std::chrono::steady_clock::now();
  start_cpu_s_ = base::get_process_cpu_s();
  if (listener_) listener_(name);
  if (!prints_) return;
  fmt::print("{:<10} {}\n", name, base::printable(what));
  std::fflush(stdout);
}

void RunLog::print(const std::string& text) const {
  if (!prints_) return;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) fmt::print("           {}\n", base::printable(line));
  std::fflush(stdout);
}

void RunLog::warn(const std::string& text) {
  if (!comm_.is_root()) return;
  warnings_.push_back(text);
  std::fflush(stdout);
  fmt::print(stderr, "carillon-precompute: warning: {}\n", base::printable(text));
}

void RunLog::warn_once(const std::string& text) {
  if (std::find(warnings_.begin(), warnings_.end(), text) == warnings_.end()) warn(text);
}

const RunPhase& RunLog::end() {
  RunPhase phase;
  phase.name = name_;
  // Read everything before the collective calls, which use CPU time.
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  const double cpu_seconds = base::get_process_cpu_s() - start_cpu_s_;
  const std::int64_t peak = base::find_memory().peak;
  phase.seconds = comm_.max(seconds);
  phase.cpu_seconds = comm_.sum(cpu_seconds);
  phase.peak_bytes = comm_.max(peak);
  phase.peak_sum_bytes = comm_.sum(peak);
  petsc::set_work_phase(petsc::WorkPhase::kOther);
  phases_.push_back(phase);
  print(fmt::format("{:.2f} s, {:.0f} MB peak on the largest rank", phase.seconds, phase.peak_bytes / 1e6));
  return phases_.back();
}

std::vector<std::int64_t> gather_peak_bytes(const comm::Communicator& comm) {
  return comm::gather(comm, std::vector<std::int64_t>{base::find_memory().peak});
}

Measured measure(const comm::Communicator& comm) {
  Measured measured;
  measured.peak_bytes = gather_peak_bytes(comm);
  measured.work = petsc::sum_work(comm);
  return measured;
}

std::string git_id() { return base::get_git_id(); }

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

}  // namespace carillon::run

// Source: Open MPI 4.1: orte/orted/orted_submit.c and mpirun -np 2 env; OpenPMIx 4.2 (PMIX_); PRRTE 3 (PRTE_); MPICH 4, Hydra (PMI_);
//   srun(1), output environment variables; slurm.h of Slurm 22.05, numbers of steps.
#include "runtime/base/environment.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <system_error>
#include <utility>

extern "C" char** environ;

namespace carillon::base {
namespace {

/// Prefixes of per-rank variables of launchers. PRTE_MCA_ and most OMPI_MCA_ variables belong to the user.
constexpr std::array<std::string_view, 29> kOfRuns{"OMPI_COMM_WORLD_",
                                                   "OMPI_UNIVERSE_",
                                                   "OMPI_FIRST_RANKS",
                                                   "OMPI_NUM_APP",
                                                   "OMPI_APP_CTX",
                                                   "OMPI_FILE_LOCATION",
                                                   "OMPI_COMMAND",
                                                   "OMPI_ARGV",
                                                   "OMPI_PARENT_",
                                                   "OMPI_MCA_ess",
                                                   "OMPI_MCA_pmix",
                                                   "OMPI_MCA_initial_wdir",
                                                   "OMPI_MCA_mpi_oversubscribe",
                                                   "OMPI_MCA_shmem_RUNTIME_QUERY_hint",
                                                   "OMPI_MCA_orte_app_num",
                                                   "OMPI_MCA_orte_bound_at_launch",
                                                   "OMPI_MCA_orte_ess",
                                                   "OMPI_MCA_orte_hnp_uri",
                                                   "OMPI_MCA_orte_jobfam_session_dir",
                                                   "OMPI_MCA_orte_launch",
                                                   "OMPI_MCA_orte_local_daemon_uri",
                                                   "OMPI_MCA_orte_num_nodes",
                                                   "OMPI_MCA_orte_precondition_transports",
                                                   "OMPI_MCA_orte_top_session_dir",
                                                   "PMIX_",
                                                   "PMI_",
                                                   "PMI2_",
                                                   "PRTE_",
                                                   "MPI_LOCAL"};

/// Open MPI settings for a single rank without a daemon.
constexpr std::array<std::pair<const char*, const char*>, 2> kLone{
    {{"OMPI_MCA_ess_singleton_isolated", "1"}, {"OMPI_MCA_orte_create_session_dirs", "0"}}};

bool is_of_run(std::string_view entry) {
  return !entry.starts_with("PRTE_MCA_") &&
         std::any_of(kOfRuns.begin(), kOfRuns.end(), [&](std::string_view begin) { return entry.starts_with(begin); });
}

/// True within a step of srun. sbatch scripts and salloc shells are steps with SLURM_PROCID 0 too; their step number is missing or
/// reserved.
bool is_slurm_step() {
  constexpr std::uint64_t kLastStep = 0xfffffff0;  // SLURM_MAX_NORMAL_STEP_ID
  const char* step = std::getenv("SLURM_STEP_ID");
  if (step == nullptr) step = std::getenv("SLURM_STEPID");
  if (step == nullptr) return false;
  std::uint64_t number = 0;
  const std::string_view text = step;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && number <= kLastStep;
}

/// Rank assigned by an MPI launcher; nullptr without one.
const char* find_rank() {
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"})
    if (const char* rank = std::getenv(name)) return rank;
  return is_slurm_step() ? std::getenv("SLURM_PROCID") : nullptr;
}

}  // namespace

bool is_launched() { return find_rank() != nullptr; }

bool is_first_of_all() { return !is_launched() || find_rank() == std::string_view("0"); }

void isolate_lone_process() {
  if (is_launched()) return;
  for (const auto& [name, value] : kLone) ::setenv(name, value, 0);
}

std::vector<std::string> make_environment() {
  std::vector<std::string> entries;
  for (char** entry = environ; *entry != nullptr; ++entry)
    if (!is_of_run(*entry)) entries.emplace_back(*entry);
  return entries;
}

std::vector<std::string> make_lone_environment() {
  std::vector<std::string> entries = make_environment();
  std::erase_if(entries, [](const std::string& entry) { return entry.starts_with("SLURM_"); });
  for (const auto& [name, value] : kLone) entries.push_back(std::string(name) + "=" + value);
  return entries;
}

}  // namespace carillon::base

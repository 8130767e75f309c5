// Environment prepared by the launcher. The resulting kernels of OpenBLAS: tests/system/petsc/kernels.py.
#include <gmock/gmock.h>

#include <array>
#include <cstdlib>
#include <string>

#include "precompute/petsc/launch/blas_kernels.hpp"
#include "precompute/petsc/launch/environment.hpp"
#include "runtime/base/environment.hpp"

namespace carillon::launch {
namespace {

using testing::AnyOf;
using testing::StrEq;

/// Environment variables for the duration of a test; null removes a variable.
class Environment {
 public:
  Environment(const char* name, const char* value) : name_(name) {
    if (const char* before = std::getenv(name)) before_ = before, was_set_ = true;
    value == nullptr ? ::unsetenv(name) : ::setenv(name, value, 1);
  }
  ~Environment() { was_set_ ? ::setenv(name_, before_.c_str(), 1) : ::unsetenv(name_); }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  const char* name_;
  std::string before_;
  bool was_set_ = false;
};

TEST(Kernels, are_ordered_by_their_instructions) {
  for (const char* name : {"Prescott", "NEHALEM", "Sandybridge", "generic"}) EXPECT_EQ(find_age(name), KernelAge::older) << name;
  for (const char* name : {"Haswell", "zen"}) EXPECT_EQ(find_age(name), KernelAge::avx2) << name;
  for (const char* name : {"SkylakeX", "Cooperlake", "a name of next year"}) EXPECT_EQ(find_age(name), KernelAge::avx512) << name;
}

TEST(Kernels, that_fit_are_never_older_than_the_processor) {
  EXPECT_THAT(find_fitting_kernels(), AnyOf("SkylakeX", "Haswell", "Zen", ""));
  EXPECT_FALSE(are_older_than_processor(find_fitting_kernels()));
  EXPECT_FALSE(are_older_than_processor(""));
  EXPECT_EQ(are_older_than_processor("Prescott"), !find_fitting_kernels().empty());
}

TEST(Environment, has_one_thread_and_keeps_the_users_choices) {
  const std::array<Environment, 6> all{{{"OMP_NUM_THREADS", "7"},
                                        {"OPENBLAS_CORETYPE", "Nehalem"},
                                        {"CARILLON_DEFAULT_KERNELS", "Prescott"},
                                        {"OMPI_MCA_pml", "cm"},
                                        {"HWLOC_COMPONENTS", nullptr},
                                        {"GLIBC_TUNABLES", nullptr}}};
  prepare_environment();
  EXPECT_THAT(std::getenv("OMP_NUM_THREADS"), StrEq("1"));
  EXPECT_THAT(std::getenv("OPENBLAS_NUM_THREADS"), StrEq("1"));
  EXPECT_THAT(std::getenv("OPENBLAS_CORETYPE"), StrEq("Nehalem"));
  EXPECT_EQ(std::getenv("CARILLON_DEFAULT_KERNELS"), nullptr);  // set by the user
  EXPECT_THAT(std::getenv("OMPI_MCA_pml"), StrEq("cm"));
  EXPECT_THAT(std::getenv("HWLOC_COMPONENTS"), StrEq("-gl"));
  EXPECT_THAT(std::getenv("GLIBC_TUNABLES"), StrEq("glibc.malloc.hugetlb=1"));
}

TEST(Environment, has_the_transport_of_one_host_only_on_one_host) {
  const Environment pml("OMPI_MCA_pml", nullptr), all("OMPI_COMM_WORLD_SIZE", "4"), here("OMPI_COMM_WORLD_LOCAL_SIZE", "2"),
      rank("OMPI_COMM_WORLD_RANK", "0");
  prepare_environment();
  EXPECT_EQ(std::getenv("OMPI_MCA_pml"), nullptr);
  ::setenv("OMPI_COMM_WORLD_LOCAL_SIZE", "4", 1);
  prepare_environment();
  EXPECT_THAT(std::getenv("OMPI_MCA_pml"), StrEq("ob1"));
}

TEST(Environment, lets_ranks_that_wait_for_others_yield_except_under_slurm) {
  const Environment yields("OMPI_MCA_mpi_yield_when_idle", nullptr), job("SLURM_JOB_ID", nullptr), all("OMPI_COMM_WORLD_SIZE", "1");
  prepare_environment();
  EXPECT_EQ(std::getenv("OMPI_MCA_mpi_yield_when_idle"), nullptr);
  ::setenv("OMPI_COMM_WORLD_SIZE", "2", 1);
  ::setenv("SLURM_JOB_ID", "7", 1);
  prepare_environment();
  EXPECT_EQ(std::getenv("OMPI_MCA_mpi_yield_when_idle"), nullptr);
  ::unsetenv("SLURM_JOB_ID");
  prepare_environment();
  EXPECT_THAT(std::getenv("OMPI_MCA_mpi_yield_when_idle"), StrEq("1"));
  ::setenv("OMPI_MCA_mpi_yield_when_idle", "0", 1);
  prepare_environment();
  EXPECT_THAT(std::getenv("OMPI_MCA_mpi_yield_when_idle"), StrEq("0"));  // set by the user
}

TEST(Environment, isolates_a_rank_that_no_launcher_started) {
  const std::array<Environment, 7> none{{{"OMPI_MCA_ess_singleton_isolated", nullptr},
                                         {"OMPI_COMM_WORLD_RANK", nullptr},
                                         {"PMIX_RANK", nullptr},
                                         {"PMI_RANK", nullptr},
                                         {"SLURM_PROCID", nullptr},
                                         {"SLURM_STEP_ID", nullptr},
                                         {"SLURM_STEPID", nullptr}}};
  {
    const Environment rank("PMIX_RANK", "0");
    prepare_environment();
    EXPECT_EQ(std::getenv("OMPI_MCA_ess_singleton_isolated"), nullptr);
  }
  prepare_environment();
  EXPECT_THAT(std::getenv("OMPI_MCA_ess_singleton_isolated"), StrEq("1"));
  ::setenv("OMPI_MCA_ess_singleton_isolated", "0", 1);
  prepare_environment();
  EXPECT_THAT(std::getenv("OMPI_MCA_ess_singleton_isolated"), StrEq("0"));  // set by the user
}

TEST(Environment, ignores_a_job_script_of_sbatch) {
  const std::array<Environment, 6> none{{{"OMPI_COMM_WORLD_RANK", nullptr},
                                         {"PMIX_RANK", nullptr},
                                         {"PMI_RANK", nullptr},
                                         {"SLURM_PROCID", "0"},
                                         {"SLURM_STEP_ID", nullptr},
                                         {"SLURM_STEPID", nullptr}}};
  EXPECT_FALSE(base::is_launched());
  for (const char* step : {"4294967291", "4294967290", "batch", ""}) {  // of sbatch, of salloc's shell
    ::setenv("SLURM_STEP_ID", step, 1);
    EXPECT_FALSE(base::is_launched()) << step;
    EXPECT_TRUE(base::is_first_of_all()) << step;
  }
  ::setenv("SLURM_STEP_ID", "0", 1);
  EXPECT_TRUE(base::is_launched());
  ::setenv("SLURM_PROCID", "3", 1);
  EXPECT_FALSE(base::is_first_of_all());
  ::unsetenv("SLURM_STEP_ID");
  ::setenv("SLURM_STEPID", "2", 1);
  EXPECT_TRUE(base::is_launched());
}

TEST(Environment, preloads_before_the_users_libraries) {
  const Environment before("LD_PRELOAD", "/lib/other.so");
  preload("/lib/ours.so");
  EXPECT_THAT(std::getenv("LD_PRELOAD"), StrEq("/lib/ours.so:/lib/other.so"));
  ::unsetenv("LD_PRELOAD");
  preload("/lib/ours.so");
  EXPECT_THAT(std::getenv("LD_PRELOAD"), StrEq("/lib/ours.so"));
}

}  // namespace
}  // namespace carillon::launch

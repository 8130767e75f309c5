// Method: OpenBLAS selects its kernels when it is loaded, so the library that a program would get is loaded here and queried.
// Source: OpenBLAS 0.3.21, README, "Run-time environment variables"; Open MPI 4.1, ompi_info --param; hwloc 2.9, HWLOC_COMPONENTS;
// ld.so(8), LD_PRELOAD; GNU C Library 2.36 manual, 38.1 (glibc.malloc.hugetlb).
#include "precompute/petsc/launch/environment.hpp"

#include <dlfcn.h>

#include <cstdlib>
#include <string>
#include <string_view>

#include "precompute/petsc/launch/blas_kernels.hpp"
#include "runtime/base/environment.hpp"

namespace carillon::launch {
namespace {

namespace fs = std::filesystem;

/// True if the launcher reports all ranks on this host.
bool is_on_one_host() {
  const char* all = std::getenv("OMPI_COMM_WORLD_SIZE");
  const char* here = std::getenv("OMPI_COMM_WORLD_LOCAL_SIZE");
  if (all != nullptr || here != nullptr) return all != nullptr && here != nullptr && std::string_view(all) == here;
  return !base::is_launched();
}

/// False for a run on one rank.
bool has_peers() {
  const char* all = std::getenv("OMPI_COMM_WORLD_SIZE");
  return all != nullptr ? std::string_view(all) != "1" : base::is_launched();
}

/// Kernels that OpenBLAS selects on this processor; empty for another BLAS, or a build for one processor only.
std::string find_default_kernels() {
  void* blas = ::dlopen("libblas.so.3", RTLD_LAZY | RTLD_LOCAL);
  if (blas == nullptr) return {};
  const auto get_name = reinterpret_cast<char* (*)()>(::dlsym(blas, "openblas_get_corename"));
  const auto get_config = reinterpret_cast<char* (*)()>(::dlsym(blas, "openblas_get_config"));
  std::string kernels;
  if (get_name != nullptr && get_config != nullptr && std::string_view(get_config()).find("DYNAMIC_ARCH") != std::string_view::npos)
    kernels = get_name();
  ::dlclose(blas);
  return kernels;
}

void choose_kernels() {
  ::unsetenv(kDefaultKernelsVariable);
  if (std::getenv(kKernelsVariable) != nullptr || find_fitting_kernels().empty()) return;
  const std::string kernels = find_default_kernels();
  if (!are_older_than_processor(kernels)) return;
  ::setenv(kKernelsVariable, find_fitting_kernels().c_str(), 1);
  ::setenv(kDefaultKernelsVariable, kernels.c_str(), 1);
}

}  // namespace

void prepare_environment() {
  ::setenv("OPENBLAS_NUM_THREADS", "1", 1);
  ::setenv("OMP_NUM_THREADS", "1", 1);
  ::unsetenv("PETSC_OPTIONS");
  ::unsetenv("PETSC_OPTIONS_YAML");
  base::isolate_lone_process();
  if (is_on_one_host()) ::setenv("OMPI_MCA_pml", "ob1", 0);
  if (has_peers() && std::getenv("SLURM_JOB_ID") == nullptr) ::setenv("OMPI_MCA_mpi_yield_when_idle", "1", 0);
  ::setenv("HWLOC_COMPONENTS", "-gl", 0);
  ::setenv("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1", 0);
  choose_kernels();
}

void preload(const fs::path& library) {
  const char* before = std::getenv("LD_PRELOAD");
  const std::string all = before == nullptr || *before == '\0' ? library.string() : library.string() + ":" + before;
  ::setenv("LD_PRELOAD", all.c_str(), 1);
}

}  // namespace carillon::launch

// Identifies the BLAS of the process. The dynamic linker chooses it (on Debian: update-alternatives), so only the running process knows.
#include <dlfcn.h>
#include <fmt/core.h>

#include <cstdlib>
#include <vector>

#include "precompute/petsc/launch/blas_kernels.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::petsc {
namespace {

template <typename Function>
Function find_symbol(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_DEFAULT, name));
}

// File that defines dgemm_, links resolved; empty if unknown.
std::string find_blas_file() {
  void* dgemm = dlsym(RTLD_DEFAULT, "dgemm_");
  Dl_info info{};
  if (dgemm == nullptr || dladdr(dgemm, &info) == 0 || info.dli_fname == nullptr) return {};
  char* resolved = realpath(info.dli_fname, nullptr);
  std::string file = resolved != nullptr ? resolved : info.dli_fname;
  std::free(resolved);
  return file;
}

bool holds(const std::string& text, const char* word) { return text.find(word) != std::string::npos; }

std::string find_blas_maker(const std::string& file) {
  if (auto* config = find_symbol<char* (*)()>("openblas_get_config"); config != nullptr) {
    std::string text = config();
    return text.substr(0, text.find_last_not_of(' ') + 1);
  }
  if (holds(file, "openblas")) return "OpenBLAS";
  if (dlsym(RTLD_DEFAULT, "bli_info_get_version_str") != nullptr || holds(file, "blis")) return "BLIS";
  if (dlsym(RTLD_DEFAULT, "mkl_get_version") != nullptr || holds(file, "mkl")) return "MKL";
  if (dlsym(RTLD_DEFAULT, "ATL_buildinfo") != nullptr || holds(file, "atlas")) return "ATLAS";
  return "reference BLAS";
}

std::string find_kernels() {
  auto* name = find_symbol<char* (*)()>("openblas_get_corename");
  return name == nullptr ? "" : name();
}

/// Kernels that OpenBLAS would use without the launcher; empty if the launcher did not change them.
std::string find_default_kernels() {
  const char* kernels = std::getenv(launch::kDefaultKernelsVariable);
  return kernels == nullptr ? "" : kernels;
}

bool is_chosen_by_user() { return std::getenv(launch::kKernelsVariable) != nullptr && find_default_kernels().empty(); }

/// ", kernels SkylakeX, OpenBLAS's own choice": the kernels and the reason; empty if the BLAS is not OpenBLAS.
std::string describe_kernels() {
  const std::string kernels = find_kernels();
  if (kernels.empty()) return {};
  const bool is_old = launch::are_older_than_processor(kernels);
  const std::string fitting = launch::find_fitting_kernels();
  if (is_chosen_by_user())
    return fmt::format(", kernels {}, named by {}{}", kernels, launch::kKernelsVariable,
                       is_old ? fmt::format(" ({} would fit this processor)", fitting) : "");
  if (is_old) return fmt::format(", kernels {}, older than this processor ({} would fit it)", kernels, fitting);
  if (find_default_kernels().empty()) return fmt::format(", kernels {}, OpenBLAS's own choice", kernels);
  return fmt::format(", kernels {}, which fit this processor (OpenBLAS alone took {})", kernels, find_default_kernels());
}

}  // namespace

std::string blas_name() {
  const std::string file = find_blas_file();
  return fmt::format("{} ({}){}", find_blas_maker(file), file.empty() ? "file unknown" : file, describe_kernels());
}

bool blas_is_reference() { return find_blas_maker(find_blas_file()) == "reference BLAS"; }

std::string describe_slow_kernels() {
  const std::string kernels = find_kernels();
  if (!launch::are_older_than_processor(kernels) || launch::find_age(kernels) != launch::KernelAge::older) return {};
  const std::string fitting = launch::find_fitting_kernels();
  const char* correction = is_chosen_by_user() ? "unset {0}, or set it to {1}" : "set {0} to {1}";
  return fmt::format("OpenBLAS runs its kernels {}, which are for older processors and slow on this one; {}", kernels,
                     fmt::format(fmt::runtime(correction), launch::kKernelsVariable, fitting));
}

void reserve_blas_memory(MPI_Comm comm) {
  constexpr std::size_t kBytes = std::size_t{160} << 20;  // OpenBLAS 0.3 takes 128 MB
  constexpr int kSize = 128;                              // larger than its small-matrix kernels, which need no such memory
  comm::Communicator(comm).agree([&] {
    void* room = std::malloc(kBytes);
    if (room == nullptr)
      throw MemoryError("Out of memory at the start: OpenBLAS alone needs 0.13 GB of address space. Raise the limit (ulimit -v).");
    std::free(room);
    using Gemm = void (*)(const char*, const char*, const int*, const int*, const int*, const double*, const double*, const int*,
                          const double*, const int*, const double*, double*, const int*);
    const auto dgemm = find_symbol<Gemm>("dgemm_");
    if (dgemm == nullptr) return;
    const std::vector<double> a(kSize * kSize, 1.0);
    std::vector<double> c(a);
    const double one = 1.0, zero = 0.0;
    dgemm("N", "N", &kSize, &kSize, &kSize, &one, a.data(), &kSize, a.data(), &kSize, &zero, c.data(), &kSize);
  });
}

}  // namespace carillon::petsc

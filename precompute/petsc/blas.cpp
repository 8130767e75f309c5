// Which BLAS the process runs on. The dynamic linker chooses it (on Debian: update-alternatives), so only the running process knows.
#include <dlfcn.h>
#include <fmt/core.h>

#include <cstdlib>
#include <vector>

#include "precompute/petsc/blas_kernels.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::petsc {
namespace {

template <typename Function>
Function find_symbol(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_DEFAULT, name));
}

// The file that holds dgemm_, links resolved; empty when it is not known.
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

}  // namespace

std::string blas_name() {
  const std::string file = find_blas_file();
  return fmt::format("{} ({}){}", find_blas_maker(file), file.empty() ? "file unknown" : file, describe_kernels());
}

bool blas_is_reference() { return find_blas_maker(find_blas_file()) == "reference BLAS"; }

void pin_blas_threads() {
  if (auto* set = find_symbol<void (*)(int)>("openblas_set_num_threads"); set != nullptr) set(1);
  if (auto* set = find_symbol<void (*)(int)>("omp_set_num_threads"); set != nullptr) set(1);
}

void reserve_blas_memory(MPI_Comm comm) {
  constexpr std::size_t kBytes = std::size_t{160} << 20;  // OpenBLAS 0.3 takes 128 MB
  constexpr int kSize = 128;                              // beyond its kernels for small matrices, which need no such memory
  run_agreed(comm, [&] {
    void* room = std::malloc(kBytes);
    if (room == nullptr)
      throw SystemError("Out of memory at the start: OpenBLAS alone needs 0.13 GB of address space. Raise the limit (ulimit -v).");
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

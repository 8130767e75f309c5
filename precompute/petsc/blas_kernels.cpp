// Method:     OpenBLAS picks the kernels of the processor, by its number, while it is loaded; OPENBLAS_CORETYPE overrides that, and is read
//             then only. So what it picked is compared with the instructions that the processor has, and if they are older, the program
//             replaces itself by itself with the variable set. A second variable tells the new one what the old one saw, and goes.
// Source:     OpenBLAS 0.3.21, driver/others/dynamic.c (names of kernels, what each needs); README, "Run-time environment variables".
// Deviations: kernels with a name that is not in the list below are newer than the list, and are left alone.
#include "precompute/petsc/blas_kernels.hpp"

#include <dlfcn.h>
#include <fmt/core.h>
#include <sys/auxv.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <string_view>

#include "precompute/petsc/session.hpp"

namespace carillon::petsc {
namespace {

constexpr const char* kChosenByUser = "OPENBLAS_CORETYPE";
constexpr const char* kSeenBefore = "CARILLON_KERNELS_BEFORE";  // ours to ourselves, between the two starts only

enum class Instructions { older, avx2, avx512 };

// What OpenBLAS took before this program started itself again; empty: it did not.
std::string kernels_before;

bool is_chosen_by_user() { return std::getenv(kChosenByUser) != nullptr && kernels_before.empty(); }

std::string find_kernels() {
  auto* name = reinterpret_cast<char* (*)()>(dlsym(RTLD_DEFAULT, "openblas_get_corename"));
  return name == nullptr ? "" : name();
}

// False for a library that was built for one processor and heeds no variable.
bool can_choose() {
  auto* config = reinterpret_cast<char* (*)()>(dlsym(RTLD_DEFAULT, "openblas_get_config"));
  return config != nullptr && std::string_view(config()).find("DYNAMIC_ARCH") != std::string_view::npos;
}

Instructions find_instructions(std::string kernels) {
  constexpr std::array<std::string_view, 21> kOlder{"generic",      "katmai",      "coppermine", "northwood",  "prescott",    "banias",
                                                    "atom",         "core2",       "penryn",     "dunnington", "nehalem",     "athlon",
                                                    "opteron_sse3", "opteron",     "barcelona",  "bobcat",     "sandybridge", "bulldozer",
                                                    "piledriver",   "steamroller", "nano"};
  constexpr std::array<std::string_view, 3> kAvx2{"haswell", "zen", "excavator"};
  std::transform(kernels.begin(), kernels.end(), kernels.begin(), [](unsigned char c) { return std::tolower(c); });
  if (std::find(kOlder.begin(), kOlder.end(), kernels) != kOlder.end()) return Instructions::older;
  if (std::find(kAvx2.begin(), kAvx2.end(), kernels) != kAvx2.end()) return Instructions::avx2;
  return Instructions::avx512;
}

// The oldest kernels that use all of the processor's vector instructions; empty when there is no telling.
std::string find_fitting_kernels() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
    return "SkylakeX";
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return __builtin_cpu_is("amd") ? "Zen" : "Haswell";
#endif
  return {};
}

bool are_old(const std::string& kernels, const std::string& fitting) {
  return !fitting.empty() && find_instructions(kernels) < find_instructions(fitting);
}

}  // namespace

void restart_with_fitting_kernels(char** argv) {
  if (const char* seen = std::getenv(kSeenBefore); seen != nullptr) {
    kernels_before = seen;
    unsetenv(kSeenBefore);
    return;
  }
  const std::string kernels = find_kernels();
  const std::string fitting = find_fitting_kernels();
  if (kernels.empty() || is_chosen_by_user() || !can_choose() || !are_old(kernels, fitting)) return;
  if (getauxval(AT_BASE) == 0) return;  // Started by naming the dynamic linker: that is what would start again.
  setenv(kChosenByUser, fitting.c_str(), 1);
  setenv(kSeenBefore, kernels.c_str(), 1);
  // By its path, so that it keeps its name in lists of processes.
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error) (void)execv(self.c_str(), argv);
  unsetenv(kChosenByUser);  // Nothing has happened: on with what there is.
  unsetenv(kSeenBefore);
}

std::string describe_kernels() {
  const std::string kernels = find_kernels();
  if (kernels.empty()) return {};
  const std::string fitting = find_fitting_kernels();
  const bool is_old = are_old(kernels, fitting);
  if (is_chosen_by_user())
    return fmt::format(", kernels {}, named by {}{}", kernels, kChosenByUser,
                       is_old ? fmt::format(" ({} would fit this processor)", fitting) : "");
  if (is_old) return fmt::format(", kernels {}, older than this processor ({} would fit it)", kernels, fitting);
  if (kernels_before.empty()) return fmt::format(", kernels {}, OpenBLAS's own choice", kernels);
  return fmt::format(", kernels {}, which fit this processor (OpenBLAS alone took {})", kernels, kernels_before);
}

std::string describe_slow_kernels() {
  const std::string kernels = find_kernels();
  const std::string fitting = find_fitting_kernels();
  if (kernels.empty() || !are_old(kernels, fitting) || find_instructions(kernels) != Instructions::older) return {};
  return fmt::format("OpenBLAS runs its kernels {}, which are for older processors and slow on this one; {}", kernels,
                     is_chosen_by_user() ? fmt::format("unset {}, or set it to {}", kChosenByUser, fitting)
                                         : fmt::format("set {} to {}", kChosenByUser, fitting));
}

}  // namespace carillon::petsc

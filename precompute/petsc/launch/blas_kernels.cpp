// Source: OpenBLAS 0.3.21, driver/others/dynamic.c (names of kernels and their requirements); README, "Run-time environment variables".
// Unlisted kernels are assumed to be newer than the list.
#include "precompute/petsc/launch/blas_kernels.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

namespace carillon::launch {

KernelAge find_age(std::string kernels) {
  constexpr std::array<std::string_view, 21> kOlder{"generic",      "katmai",      "coppermine", "northwood",  "prescott",    "banias",
                                                    "atom",         "core2",       "penryn",     "dunnington", "nehalem",     "athlon",
                                                    "opteron_sse3", "opteron",     "barcelona",  "bobcat",     "sandybridge", "bulldozer",
                                                    "piledriver",   "steamroller", "nano"};
  constexpr std::array<std::string_view, 3> kAvx2{"haswell", "zen", "excavator"};
  std::transform(kernels.begin(), kernels.end(), kernels.begin(), [](unsigned char c) { return std::tolower(c); });
  if (std::find(kOlder.begin(), kOlder.end(), kernels) != kOlder.end()) return KernelAge::older;
  if (std::find(kAvx2.begin(), kAvx2.end(), kernels) != kAvx2.end()) return KernelAge::avx2;
  return KernelAge::avx512;
}

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

bool are_older_than_processor(const std::string& kernels) {
  const std::string fitting = find_fitting_kernels();
  return !kernels.empty() && !fitting.empty() && find_age(kernels) < find_age(fitting);
}

}  // namespace carillon::launch

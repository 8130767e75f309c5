#include "runtime/base/instructions.hpp"

#include <algorithm>
#include <cstdlib>
#include <string_view>

namespace carillon::base {
namespace {

Instructions find_best() noexcept {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
    return Instructions::kAvx512;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return Instructions::kAvx2;
#endif
  return Instructions::kPlain;
}

Instructions find_allowed() noexcept {
  const char* name = std::getenv("CARILLON_INSTRUCTIONS");
  const std::string_view allowed = name != nullptr ? name : "";
  return allowed == "plain" ? Instructions::kPlain : allowed == "avx2" ? Instructions::kAvx2 : Instructions::kAvx512;
}

}  // namespace

Instructions find_instructions() noexcept {
  static const Instructions instructions = std::min(find_best(), find_allowed());
  return instructions;
}

}  // namespace carillon::base

#include "runtime/base/instructions.hpp"

#include <hwy/targets.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <string_view>

namespace carillon::base {
namespace {

bool is_supported(Instructions set) noexcept { return (HWY_SUPPORTED_TARGETS & HWY_TARGETS & get_targets(set)) != 0; }

/// Best supported set, not above the one that the environment names.
Instructions find_best() noexcept {
  const char* value = std::getenv("CARILLON_INSTRUCTIONS");
  const std::string_view name = value != nullptr ? value : "";
  Instructions best{};
  for (std::size_t s = 0; s < kInstructionNames.size(); ++s) {
    if (is_supported(static_cast<Instructions>(s))) best = static_cast<Instructions>(s);
    if (name == kInstructionNames[s]) break;
  }
  return best;
}

std::atomic<Instructions> limit{Instructions::kBest};

}  // namespace

Instructions find_instructions() noexcept {
  static const Instructions instructions = find_best();
  return std::min(instructions, limit.load(std::memory_order_relaxed));
}

void limit_instructions(Instructions most) noexcept { limit.store(most, std::memory_order_relaxed); }

std::int64_t get_targets(Instructions set) noexcept {
  constexpr std::array<std::int64_t, kInstructionNames.size()> kTargets{
      HWY_EMU128 | HWY_SCALAR, HWY_WASM, HWY_NEON, HWY_SSE4, HWY_AVX2, HWY_AVX3, 0};
  return kTargets[static_cast<std::size_t>(set)];
}

std::vector<Instructions> list_instructions() {
  std::vector<Instructions> sets;
  for (std::size_t s = 0; s <= static_cast<std::size_t>(find_instructions()); ++s)
    if (is_supported(static_cast<Instructions>(s))) sets.push_back(static_cast<Instructions>(s));
  return sets;
}

}  // namespace carillon::base

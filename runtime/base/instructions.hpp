// Run-time selection of the instruction set of loops that are compiled for several (simd.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace carillon::base {

/// Ascending on each processor. kPlain: no instructions beyond those of every processor; kSimd128: WebAssembly; kAvx2 includes FMA; kAvx512
/// is F, BW, DQ and VL; kBest: the best there is.
enum class Instructions : std::uint8_t { kPlain, kSimd128, kNeon, kSse4, kAvx2, kAvx512, kBest };

inline constexpr std::array kInstructionNames{"plain", "simd128", "neon", "sse4", "avx2", "avx512", "best"};
inline const char* get_name(Instructions set) noexcept { return kInstructionNames[static_cast<std::size_t>(set)]; }

/// Best set of this processor, limited by the environment variable CARILLON_INSTRUCTIONS (one of the names; for comparisons; other values:
/// no limit) and by limit_instructions(). Cached. Any thread.
Instructions find_instructions() noexcept;

/// For tests: nothing above `most` is used until the next call. Loops that were chosen before stay.
void limit_instructions(Instructions most) noexcept;

/// All supported and allowed sets that loops are compiled for, ascending.
std::vector<Instructions> list_instructions();

/// Highway's targets of a set, as bits (hwy/targets.h). Any thread.
std::int64_t get_targets(Instructions set) noexcept;

}  // namespace carillon::base

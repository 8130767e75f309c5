// Run-time selection of the instruction set of multi-version loops.
#pragma once

namespace carillon::base {

/// Ascending. kAvx2 includes FMA; kAvx512 is F, DQ and VL.
enum class Instructions { kPlain, kAvx2, kAvx512 };

/// Best set of this processor, limited by the environment variable CARILLON_INSTRUCTIONS ("plain", "avx2" or "avx512"; for comparisons;
/// other values: no limit). Cached. kPlain on processors other than x86-64.
Instructions find_instructions() noexcept;

/// True if supported and allowed.
inline bool has_instructions(Instructions wanted) noexcept { return find_instructions() >= wanted; }

}  // namespace carillon::base

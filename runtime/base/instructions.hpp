// Selects the instruction set for loops compiled in several versions.
#pragma once

namespace carillon::base {

/// Least first. kAvx2 comes with FMA; kAvx512 is F, DQ and VL.
enum class Instructions { kPlain, kAvx2, kAvx512 };

/// The best that this processor has, and no more than the environment variable CARILLON_INSTRUCTIONS allows ("plain", "avx2" or "avx512";
/// for comparisons; any other value: no limit). Read once. kPlain on processors other than x86-64.
Instructions find_instructions() noexcept;

/// Does this processor have them, and are they allowed?
inline bool has_instructions(Instructions wanted) noexcept { return find_instructions() >= wanted; }

}  // namespace carillon::base

// Loops that Highway compiles once for every instruction set, and the choice of a set when the program runs. Source of such loops, listed
// by carillon_simd_sources() in CMake:
//
//     #include "runtime/base/simd.hpp"
//     HWY_BEFORE_NAMESPACE();
//     namespace carillon::part::HWY_NAMESPACE {
//     void add(...) {...}
//     }  // namespace carillon::part::HWY_NAMESPACE
//     HWY_AFTER_NAMESPACE();
//     #if HWY_ONCE
//     namespace carillon::part {
//     HWY_EXPORT(add);
//     void add(...) { base::choose(HWY_DISPATCH_TABLE(add))(...); }
//     }  // namespace carillon::part
//     #endif
//
// The file is included once more for each set, and with it the end of this one. An exported function is not noexcept (Highway 1.0), and
// lambdas have HWY_ATTR before their brace.
#ifndef CARILLON_SIMD
#define CARILLON_SIMD

// Compiled are: SSE4, AVX2, AVX-512; NEON; WebAssembly SIMD; and plain C++. Vectors of unknown length cannot be in arrays.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/targets.h>

#include <algorithm>
#include <cstddef>

#include "runtime/base/instructions.hpp"

/// Width of GCC's vector types in such loops: that of a register of the set. GCC 12 keeps wider ones in memory, at a tenth of the speed.
#define CARILLON_REGISTER_BYTES (HWY_MAX_BYTES < 16 ? 16 : HWY_MAX_BYTES)

namespace carillon::base {

/// The function of HWY_DISPATCH_TABLE(function) for a set, or the best one below it that is supported. [audio-thread]
template <typename Function, std::size_t kCount>
Function choose(const Function (&table)[kCount], Instructions wanted = Instructions::kBest) noexcept {
  if constexpr (kCount == 1) {
    return table[0];
  } else {
    hwy::ChosenTarget target;
    target.Update(get_targets(std::min(wanted, find_instructions())));
    return table[target.GetIndex()];
  }
}

}  // namespace carillon::base

#endif  // CARILLON_SIMD

#ifdef HWY_TARGET_INCLUDE  // by carillon_simd_sources(); there is one set for WebAssembly
#include <hwy/foreach_target.h>
#endif
#include <hwy/highway.h>

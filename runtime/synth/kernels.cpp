// Method:     each kernels_*.cpp defines one table of functions.
// Deviations: processors other than x86-64 use the plain kernels. WebAssembly cannot query features: there are two builds, with and without
//             SIMD for this file and the kernels.
#include "runtime/synth/kernels.hpp"

#include "runtime/base/instructions.hpp"

namespace carillon::synth {

Isa find_best_isa() noexcept {
#if defined(__x86_64__)
  if (base::has_instructions(base::Instructions::kAvx512)) return Isa::kAvx512;
  if (base::has_instructions(base::Instructions::kAvx2)) return Isa::kAvx2;
  return Isa::kSse2;
#elif defined(__wasm_simd128__)
  return Isa::kSimd128;
#else
  return Isa::kPlain;
#endif
}

const Kernels& get_kernels(Isa isa) noexcept {
#if defined(__x86_64__)
  const Isa best = find_best_isa();
  switch (isa < best ? isa : best) {
    case Isa::kAvx512:
      return kAvx512Kernels;
    case Isa::kAvx2:
      return kAvx2Kernels;
    case Isa::kSse2:
      return kSse2Kernels;
    default:
      return kPlainKernels;
  }
#elif defined(__wasm_simd128__)
  return isa == Isa::kPlain ? kPlainKernels : kSimd128Kernels;
#else
  static_cast<void>(isa);
  return kPlainKernels;
#endif
}

const char* get_name(Isa isa) noexcept {
  switch (isa) {
    case Isa::kPlain:
      return "plain";
    case Isa::kSimd128:
      return "simd128";
    case Isa::kSse2:
      return "sse2";
    case Isa::kAvx2:
      return "avx2";
    case Isa::kAvx512:
      return "avx512";
    case Isa::kBest:
      return "best";
  }
  return "";
}

}  // namespace carillon::synth

// Flushes denormal numbers during synthesis.
#pragma once

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace carillon::synth {

/// Scope in which denormal results are flushed to zero (FTZ) and denormal operands count as zero (DAZ): on many processors they cost a
/// hundred cycles each. Restores the caller's setting. No effect on other processors than x86-64 and in WebAssembly, where ResonatorBank
/// clears small states itself.
class FpGuard {
 public:
#if defined(__x86_64__)
  FpGuard() noexcept : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040U); }
  ~FpGuard() { _mm_setcsr(before_); }
#else
  FpGuard() noexcept {}
  ~FpGuard() {}
#endif
  FpGuard(const FpGuard&) = delete;
  FpGuard& operator=(const FpGuard&) = delete;

 private:
#if defined(__x86_64__)
  unsigned before_;
#endif
};

}  // namespace carillon::synth

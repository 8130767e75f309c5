// Denormal numbers off while sound is made.
#pragma once

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace carillon::synth {

/// While one of these lives, results that would be denormal are zero (FTZ) and denormal operands count as zero (DAZ): on many processors
/// they cost a hundred cycles each. The caller's setting comes back afterwards. Does nothing on processors other than x86-64, and in
/// WebAssembly, which has no such setting: there Voice clears small states itself.
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

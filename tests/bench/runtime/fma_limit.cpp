// Method:     chains of multiply-adds that do not wait for each other, more of them than latency times ports, nothing but registers.
#include "tests/bench/runtime/fma_limit.hpp"

#include <immintrin.h>

#include <algorithm>

#include "runtime/base/clock.hpp"

namespace carillon::bench {
namespace {

constexpr long kTurns = 50000;

[[gnu::target("avx512f")]] float run_avx512(float start) {
  __m512 chain[24];
  const __m512 a = _mm512_set1_ps(0.999F), b = _mm512_set1_ps(start);
#pragma GCC unroll 24
  for (int i = 0; i < 24; ++i) chain[i] = _mm512_set1_ps(start + static_cast<float>(i));
  for (long turn = 0; turn < kTurns; ++turn) {
#pragma GCC unroll 24
    for (int i = 0; i < 24; ++i) chain[i] = _mm512_fmadd_ps(chain[i], a, b);
  }
  __m512 sum = chain[0];
#pragma GCC unroll 24
  for (int i = 1; i < 24; ++i) sum = _mm512_add_ps(sum, chain[i]);
  return _mm512_cvtss_f32(sum);
}

[[gnu::target("avx2,fma")]] float run_avx2(float start) {
  __m256 chain[12];
  const __m256 a = _mm256_set1_ps(0.999F), b = _mm256_set1_ps(start);
#pragma GCC unroll 12
  for (int i = 0; i < 12; ++i) chain[i] = _mm256_set1_ps(start + static_cast<float>(i));
  for (long turn = 0; turn < kTurns; ++turn) {
#pragma GCC unroll 12
    for (int i = 0; i < 12; ++i) chain[i] = _mm256_fmadd_ps(chain[i], a, b);
  }
  __m256 sum = chain[0];
#pragma GCC unroll 12
  for (int i = 1; i < 12; ++i) sum = _mm256_add_ps(sum, chain[i]);
  return _mm256_cvtss_f32(sum);
}

float run_sse2(float start) {
  __m128 chain[12];
  const __m128 a = _mm_set1_ps(0.999F), b = _mm_set1_ps(start);
#pragma GCC unroll 12
  for (int i = 0; i < 12; ++i) chain[i] = _mm_set1_ps(start + static_cast<float>(i));
  for (long turn = 0; turn < kTurns; ++turn) {
#pragma GCC unroll 12
    for (int i = 0; i < 12; ++i) chain[i] = _mm_add_ps(_mm_mul_ps(chain[i], a), b);
  }
  __m128 sum = chain[0];
#pragma GCC unroll 12
  for (int i = 1; i < 12; ++i) sum = _mm_add_ps(sum, chain[i]);
  return _mm_cvtss_f32(sum);
}

}  // namespace

double measure_fma_lanes_per_s(synth::Isa isa, double seconds) {
  volatile float keep = 1.0F;
  double best = 0.0;
  const double until = base::get_thread_cpu_s() + seconds;
  double now = base::get_thread_cpu_s();
  while (now < until) {
    double lanes = 0.0;
    if (isa == synth::Isa::kAvx512) {
      keep = run_avx512(keep);
      lanes = 16.0 * 24.0;
    } else if (isa == synth::Isa::kAvx2) {
      keep = run_avx2(keep);
      lanes = 8.0 * 12.0;
    } else {
      keep = run_sse2(keep);
      lanes = 4.0 * 12.0;
    }
    const double later = base::get_thread_cpu_s();
    best = std::max(best, lanes * static_cast<double>(kTurns) / (later - now));
    now = later;
    keep = 1.0F;
  }
  return best;
}

}  // namespace carillon::bench

// Method:     kernels_body.inl and kernels_receiver.inl on AVX2 and FMA: 8 lanes, 16 registers.
// Source:     Intel's intrinsics guide.
#include <immintrin.h>

#include "runtime/synth/kernels.hpp"

namespace carillon::synth {
namespace {

struct F {
  static constexpr int kWidth = 8;
  __m256 v;
  static F load(const float* at) { return {_mm256_loadu_ps(at)}; }
  static F all(float x) { return {_mm256_set1_ps(x)}; }
  static F pair(const float* at) {  // two numbers, again and again
    return {_mm256_castsi256_ps(_mm256_broadcastq_epi64(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(at))))};
  }
  static F zero() { return {_mm256_setzero_ps()}; }
  static F convert(const std::int16_t* at) {
    return {_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(at))))};
  }
  void store(float* at) const { _mm256_storeu_ps(at, v); }
  float sum() const {
    const __m128 quarter = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
    const __m128 half = _mm_add_ps(quarter, _mm_movehl_ps(quarter, quarter));
    return _mm_cvtss_f32(_mm_add_ss(half, _mm_shuffle_ps(half, half, 1)));
  }
  friend F operator+(F a, F b) { return {_mm256_add_ps(a.v, b.v)}; }
  friend F operator-(F a, F b) { return {_mm256_sub_ps(a.v, b.v)}; }
  friend F operator*(F a, F b) { return {_mm256_mul_ps(a.v, b.v)}; }
  friend F operator/(F a, F b) { return {_mm256_div_ps(a.v, b.v)}; }
};
inline F fma(F a, F b, F c) { return {_mm256_fmadd_ps(a.v, b.v, c.v)}; }
inline F less(F c, F a, F b) { return {_mm256_fnmadd_ps(a.v, b.v, c.v)}; }  // c - a b

struct D {
  __m256d lo, hi;
  static D load(const double* at) { return {_mm256_loadu_pd(at), _mm256_loadu_pd(at + 4)}; }
  static D all(double x) { return {_mm256_set1_pd(x), _mm256_set1_pd(x)}; }
  static D zero() { return {_mm256_setzero_pd(), _mm256_setzero_pd()}; }
  static D widen(F x) { return {_mm256_cvtps_pd(_mm256_castps256_ps128(x.v)), _mm256_cvtps_pd(_mm256_extractf128_ps(x.v, 1))}; }
  void store(double* at) const {
    _mm256_storeu_pd(at, lo);
    _mm256_storeu_pd(at + 4, hi);
  }
  F narrow() const { return {_mm256_insertf128_ps(_mm256_castps128_ps256(_mm256_cvtpd_ps(lo)), _mm256_cvtpd_ps(hi), 1)}; }
  friend D operator+(D a, D b) { return {_mm256_add_pd(a.lo, b.lo), _mm256_add_pd(a.hi, b.hi)}; }
  friend D operator*(D a, D b) { return {_mm256_mul_pd(a.lo, b.lo), _mm256_mul_pd(a.hi, b.hi)}; }
};
inline D more(D c, D a, D b) { return {_mm256_fmadd_pd(a.lo, b.lo, c.lo), _mm256_fmadd_pd(a.hi, b.hi, c.hi)}; }    // c + a b
inline D less(D c, D a, D b) { return {_mm256_fnmadd_pd(a.lo, b.lo, c.lo), _mm256_fnmadd_pd(a.hi, b.hi, c.hi)}; }  // c - a b

using P = F;
constexpr int kVectors = 4, kHeldColumns = 3;
#include "runtime/synth/kernels_body.inl"
#include "runtime/synth/kernels_receiver.inl"

}  // namespace

const Kernels kAvx2Kernels{Isa::kAvx2,    advance,         emit,           ring,  strike,   drive,
                           emit_weighted, strike_and_keep, drive_and_keep, weigh, convolve, read};

}  // namespace carillon::synth

// Method:     kernels_body.inl and kernels_receiver.inl on AVX-512 (F, DQ, VL): 16 lanes, 32 registers.
// Source:     Intel's intrinsics guide.
#include <immintrin.h>

#include "runtime/synth/kernels.hpp"

namespace carillon::synth {
namespace {

struct F {
  static constexpr int kWidth = 16;
  __m512 v;
  static F load(const float* at) { return {_mm512_loadu_ps(at)}; }
  static F all(float x) { return {_mm512_set1_ps(x)}; }
  static F pair(const float* at) {  // two numbers, again and again
    return {_mm512_castsi512_ps(_mm512_broadcastq_epi64(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(at))))};
  }
  static F zero() { return {_mm512_setzero_ps()}; }
  static F convert(const std::int16_t* at) {
    return {_mm512_cvtepi32_ps(_mm512_cvtepi16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(at))))};
  }
  void store(float* at) const { _mm512_storeu_ps(at, v); }
  float sum() const {
    const __m256 lanes = _mm256_add_ps(_mm512_castps512_ps256(v), _mm512_extractf32x8_ps(v, 1));
    const __m128 quarter = _mm_add_ps(_mm256_castps256_ps128(lanes), _mm256_extractf128_ps(lanes, 1));
    const __m128 half = _mm_add_ps(quarter, _mm_movehl_ps(quarter, quarter));
    return _mm_cvtss_f32(_mm_add_ss(half, _mm_shuffle_ps(half, half, 1)));
  }
  friend F operator+(F a, F b) { return {_mm512_add_ps(a.v, b.v)}; }
  friend F operator-(F a, F b) { return {_mm512_sub_ps(a.v, b.v)}; }
  friend F operator*(F a, F b) { return {_mm512_mul_ps(a.v, b.v)}; }
  friend F operator/(F a, F b) { return {_mm512_div_ps(a.v, b.v)}; }
};
inline F fma(F a, F b, F c) { return {_mm512_fmadd_ps(a.v, b.v, c.v)}; }
inline F less(F c, F a, F b) { return {_mm512_fnmadd_ps(a.v, b.v, c.v)}; }  // c - a b

struct D {
  __m512d lo, hi;
  static D load(const double* at) { return {_mm512_loadu_pd(at), _mm512_loadu_pd(at + 8)}; }
  static D all(double x) { return {_mm512_set1_pd(x), _mm512_set1_pd(x)}; }
  static D zero() { return {_mm512_setzero_pd(), _mm512_setzero_pd()}; }
  static D widen(F x) { return {_mm512_cvtps_pd(_mm512_castps512_ps256(x.v)), _mm512_cvtps_pd(_mm512_extractf32x8_ps(x.v, 1))}; }
  void store(double* at) const {
    _mm512_storeu_pd(at, lo);
    _mm512_storeu_pd(at + 8, hi);
  }
  F narrow() const { return {_mm512_insertf32x8(_mm512_castps256_ps512(_mm512_cvtpd_ps(lo)), _mm512_cvtpd_ps(hi), 1)}; }
  friend D operator+(D a, D b) { return {_mm512_add_pd(a.lo, b.lo), _mm512_add_pd(a.hi, b.hi)}; }
  friend D operator*(D a, D b) { return {_mm512_mul_pd(a.lo, b.lo), _mm512_mul_pd(a.hi, b.hi)}; }
};
inline D more(D c, D a, D b) { return {_mm512_fmadd_pd(a.lo, b.lo, c.lo), _mm512_fmadd_pd(a.hi, b.hi, c.hi)}; }    // c + a b
inline D less(D c, D a, D b) { return {_mm512_fnmadd_pd(a.lo, b.lo, c.lo), _mm512_fnmadd_pd(a.hi, b.hi, c.hi)}; }  // c - a b

using P = F;
constexpr int kVectors = 2, kHeldColumns = 8;
#include "runtime/synth/kernels_body.inl"
#include "runtime/synth/kernels_receiver.inl"

}  // namespace

const Kernels kAvx512Kernels{Isa::kAvx512,  advance,         emit,           ring,  strike,   drive,
                             emit_weighted, strike_and_keep, drive_and_keep, weigh, convolve, read};

}  // namespace carillon::synth

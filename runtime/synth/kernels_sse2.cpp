// Method:     kernels_body.inl and kernels_receiver.inl on SSE2, which every x86-64 processor has: 4 lanes, no fused multiply-add.
// Source:     Intel's intrinsics guide.
#include <immintrin.h>

#include "runtime/synth/kernels.hpp"

namespace carillon::synth {
namespace {

struct F {
  static constexpr int kWidth = 4;
  __m128 v;
  static F load(const float* at) { return {_mm_loadu_ps(at)}; }
  static F all(float x) { return {_mm_set1_ps(x)}; }
  static F pair(const float* at) {  // two numbers, again and again
    const __m128 x = _mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(at)));
    return {_mm_movelh_ps(x, x)};
  }
  static F zero() { return {_mm_setzero_ps()}; }
  static F convert(const std::int16_t* at) {
    const __m128i x = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(at));
    return {_mm_cvtepi32_ps(_mm_srai_epi32(_mm_unpacklo_epi16(x, x), 16))};
  }
  void store(float* at) const { _mm_storeu_ps(at, v); }
  float sum() const {
    const __m128 half = _mm_add_ps(v, _mm_movehl_ps(v, v));
    return _mm_cvtss_f32(_mm_add_ss(half, _mm_shuffle_ps(half, half, 1)));
  }
  friend F operator+(F a, F b) { return {_mm_add_ps(a.v, b.v)}; }
  friend F operator-(F a, F b) { return {_mm_sub_ps(a.v, b.v)}; }
  friend F operator*(F a, F b) { return {_mm_mul_ps(a.v, b.v)}; }
  friend F operator/(F a, F b) { return {_mm_div_ps(a.v, b.v)}; }
};
inline F fma(F a, F b, F c) { return {_mm_add_ps(_mm_mul_ps(a.v, b.v), c.v)}; }
inline F less(F c, F a, F b) { return {_mm_sub_ps(c.v, _mm_mul_ps(a.v, b.v))}; }  // c - a b

struct D {
  __m128d lo, hi;
  static D load(const double* at) { return {_mm_loadu_pd(at), _mm_loadu_pd(at + 2)}; }
  static D all(double x) { return {_mm_set1_pd(x), _mm_set1_pd(x)}; }
  static D zero() { return {_mm_setzero_pd(), _mm_setzero_pd()}; }
  static D widen(F x) { return {_mm_cvtps_pd(x.v), _mm_cvtps_pd(_mm_movehl_ps(x.v, x.v))}; }
  void store(double* at) const {
    _mm_storeu_pd(at, lo);
    _mm_storeu_pd(at + 2, hi);
  }
  F narrow() const { return {_mm_movelh_ps(_mm_cvtpd_ps(lo), _mm_cvtpd_ps(hi))}; }
  friend D operator+(D a, D b) { return {_mm_add_pd(a.lo, b.lo), _mm_add_pd(a.hi, b.hi)}; }
  friend D operator*(D a, D b) { return {_mm_mul_pd(a.lo, b.lo), _mm_mul_pd(a.hi, b.hi)}; }
};
inline D more(D c, D a, D b) { return {_mm_add_pd(c.lo, _mm_mul_pd(a.lo, b.lo)), _mm_add_pd(c.hi, _mm_mul_pd(a.hi, b.hi))}; }  // c + a b
inline D less(D c, D a, D b) { return {_mm_sub_pd(c.lo, _mm_mul_pd(a.lo, b.lo)), _mm_sub_pd(c.hi, _mm_mul_pd(a.hi, b.hi))}; }  // c - a b

using P = F;
constexpr int kVectors = 8, kHeldColumns = 1;
#include "runtime/synth/kernels_body.inl"
#include "runtime/synth/kernels_receiver.inl"

}  // namespace

const Kernels kSse2Kernels{Isa::kSse2,    advance,         emit,           ring,  strike,   drive,
                           emit_weighted, strike_and_keep, drive_and_keep, weigh, convolve, read};

}  // namespace carillon::synth

// Method:     kernels_body.inl and kernels_receiver.inl in WebAssembly SIMD: 4 lanes, no fused multiply-add.
// Source:     WebAssembly SIMD proposal; clang's wasm_simd128.h.
#include <wasm_simd128.h>

#include "runtime/synth/kernels.hpp"

namespace carillon::synth {
namespace {

struct F {
  static constexpr int kWidth = 4;
  v128_t v;
  static F load(const float* at) { return {wasm_v128_load(at)}; }
  static F all(float x) { return {wasm_f32x4_splat(x)}; }
  static F pair(const float* at) { return {wasm_v128_load64_splat(at)}; }  // two numbers, repeated
  static F zero() { return {wasm_f32x4_const(0.0F, 0.0F, 0.0F, 0.0F)}; }
  static F convert(const std::int16_t* at) { return {wasm_f32x4_convert_i32x4(wasm_i32x4_load16x4(at))}; }
  void store(float* at) const { wasm_v128_store(at, v); }
  float sum() const {
    const v128_t half = wasm_f32x4_add(v, wasm_i32x4_shuffle(v, v, 2, 3, 2, 3));
    return wasm_f32x4_extract_lane(half, 0) + wasm_f32x4_extract_lane(half, 1);
  }
  friend F operator+(F a, F b) { return {wasm_f32x4_add(a.v, b.v)}; }
  friend F operator-(F a, F b) { return {wasm_f32x4_sub(a.v, b.v)}; }
  friend F operator*(F a, F b) { return {wasm_f32x4_mul(a.v, b.v)}; }
  friend F operator/(F a, F b) { return {wasm_f32x4_div(a.v, b.v)}; }
};
inline F fma(F a, F b, F c) { return {wasm_f32x4_add(wasm_f32x4_mul(a.v, b.v), c.v)}; }
inline F less(F c, F a, F b) { return {wasm_f32x4_sub(c.v, wasm_f32x4_mul(a.v, b.v))}; }  // c - a b

struct D {
  v128_t lo, hi;
  static D load(const double* at) { return {wasm_v128_load(at), wasm_v128_load(at + 2)}; }
  static D all(double x) { return {wasm_f64x2_splat(x), wasm_f64x2_splat(x)}; }
  static D zero() { return {wasm_f64x2_const(0.0, 0.0), wasm_f64x2_const(0.0, 0.0)}; }
  static D widen(F x) {
    return {wasm_f64x2_promote_low_f32x4(x.v), wasm_f64x2_promote_low_f32x4(wasm_i32x4_shuffle(x.v, x.v, 2, 3, 2, 3))};
  }
  void store(double* at) const {
    wasm_v128_store(at, lo);
    wasm_v128_store(at + 2, hi);
  }
  F narrow() const { return {wasm_i32x4_shuffle(wasm_f32x4_demote_f64x2_zero(lo), wasm_f32x4_demote_f64x2_zero(hi), 0, 1, 4, 5)}; }
  friend D operator+(D a, D b) { return {wasm_f64x2_add(a.lo, b.lo), wasm_f64x2_add(a.hi, b.hi)}; }
  friend D operator*(D a, D b) { return {wasm_f64x2_mul(a.lo, b.lo), wasm_f64x2_mul(a.hi, b.hi)}; }
};
inline D more(D c, D a, D b) {  // c + a b
  return {wasm_f64x2_add(c.lo, wasm_f64x2_mul(a.lo, b.lo)), wasm_f64x2_add(c.hi, wasm_f64x2_mul(a.hi, b.hi))};
}
inline D less(D c, D a, D b) {  // c - a b
  return {wasm_f64x2_sub(c.lo, wasm_f64x2_mul(a.lo, b.lo)), wasm_f64x2_sub(c.hi, wasm_f64x2_mul(a.hi, b.hi))};
}

using P = F;
constexpr int kVectors = 8, kHeldColumns = 1;
#include "runtime/synth/kernels_body.inl"
#include "runtime/synth/kernels_receiver.inl"

}  // namespace

const Kernels kSimd128Kernels{Isa::kSimd128, advance,         emit,           ring,  strike,   drive,
                              emit_weighted, strike_and_keep, drive_and_keep, weigh, convolve, read};

}  // namespace carillon::synth

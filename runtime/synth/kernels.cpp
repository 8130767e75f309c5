// Method:     kernels_body.inl and kernels_receiver.inl in vectors of Highway. Without contraction, as they say where to fuse.
// Deviations: doubles in WebAssembly are vectors of the compiler, since Highway 1.0 has none there.
#include "runtime/synth/kernels.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::synth::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
const hn::ScalableTag<float> kFloats;

struct F {
  static constexpr int kWidth = static_cast<int>(hn::MaxLanes(kFloats));
  hn::Vec<decltype(kFloats)> v;
  static F load(const float* at) { return {hn::LoadU(kFloats, at)}; }
  static F all(float x) { return {hn::Set(kFloats, x)}; }
  static F zero() { return {hn::Zero(kFloats)}; }
  static F convert(const std::int16_t* at) {
    const hn::RebindToSigned<decltype(kFloats)> ints;
    return {hn::ConvertTo(kFloats, hn::PromoteTo(ints, hn::LoadU(hn::Rebind<std::int16_t, decltype(kFloats)>(), at)))};
  }
#if HWY_TARGET != HWY_SCALAR
  static F pair(const float* at) {  // two numbers, again and again
    std::uint64_t both;
    __builtin_memcpy(&both, at, sizeof both);
    return {hn::BitCast(kFloats, hn::Set(hn::Repartition<std::uint64_t, decltype(kFloats)>(), both))};
  }
#endif
  void store(float* at) const { hn::StoreU(v, kFloats, at); }
  float sum() const { return hn::GetLane(hn::SumOfLanes(kFloats, v)); }
};
// Not friends: g++ 12 compiles those without the instruction set.
inline F operator+(F a, F b) { return {hn::Add(a.v, b.v)}; }
inline F operator-(F a, F b) { return {hn::Sub(a.v, b.v)}; }
inline F operator*(F a, F b) { return {hn::Mul(a.v, b.v)}; }
inline F operator/(F a, F b) { return {hn::Div(a.v, b.v)}; }
inline F fma(F a, F b, F c) { return {hn::MulAdd(a.v, b.v, c.v)}; }
inline F less(F c, F a, F b) { return {hn::NegMulAdd(a.v, b.v, c.v)}; }  // c - a b

#if HWY_HAVE_FLOAT64
const hn::ScalableTag<double> kDoubles;
using Doubles = hn::Vec<decltype(kDoubles)>;
inline Doubles load_doubles(const double* at) { return hn::LoadU(kDoubles, at); }
inline void store_doubles(Doubles x, double* at) { hn::StoreU(x, kDoubles, at); }
inline Doubles set_doubles(double x) { return hn::Set(kDoubles, x); }
inline Doubles add_product(Doubles c, Doubles a, Doubles b) { return hn::MulAdd(a, b, c); }
inline Doubles take_product(Doubles c, Doubles a, Doubles b) { return hn::NegMulAdd(a, b, c); }
#else
typedef double Doubles __attribute__((vector_size(HWY_MAX_BYTES)));
inline Doubles load_doubles(const double* at) {
  Doubles x;
  __builtin_memcpy(&x, at, sizeof x);
  return x;
}
inline void store_doubles(Doubles x, double* at) { __builtin_memcpy(at, &x, sizeof x); }
inline Doubles set_doubles(double x) { return Doubles{} + x; }
inline Doubles add_product(Doubles c, Doubles a, Doubles b) { return c + a * b; }
inline Doubles take_product(Doubles c, Doubles a, Doubles b) { return c - a * b; }
#endif

/// As many doubles as F has floats.
struct D {
  static constexpr int kLanes = sizeof(Doubles) / sizeof(double);
  Doubles lo, hi;  // plain C++ has one number, `lo`
  static constexpr bool kTwo = F::kWidth > kLanes;
  static D load(const double* at) { return {load_doubles(at), load_doubles(kTwo ? at + kLanes : at)}; }
  static D all(double x) { return {set_doubles(x), set_doubles(x)}; }
  void store(double* at) const {
    store_doubles(lo, at);
    if constexpr (kTwo) store_doubles(hi, at + kLanes);
  }
#if HWY_TARGET == HWY_SCALAR
  static D widen(F x) { return {hn::PromoteTo(kDoubles, x.v), hn::PromoteTo(kDoubles, x.v)}; }
  F narrow() const { return {hn::DemoteTo(kFloats, lo)}; }
#elif HWY_HAVE_FLOAT64
  static D widen(F x) {
    return {hn::PromoteTo(kDoubles, hn::LowerHalf(x.v)), hn::PromoteTo(kDoubles, hn::UpperHalf(hn::Half<decltype(kFloats)>(), x.v))};
  }
  F narrow() const {
    const hn::Half<decltype(kFloats)> half;
    return {hn::Combine(kFloats, hn::DemoteTo(half, hi), hn::DemoteTo(half, lo))};
  }
#else
  static D widen(F x) {
    return {Doubles(wasm_f64x2_promote_low_f32x4(x.v.raw)), Doubles(wasm_f64x2_promote_low_f32x4(hn::Shuffle1032(x.v).raw))};
  }
  F narrow() const {
    const auto demote = [](Doubles half) HWY_ATTR { return hn::Vec<decltype(kFloats)>{wasm_f32x4_demote_f64x2_zero(v128_t(half))}; };
    return {hn::ConcatLowerLower(kFloats, demote(hi), demote(lo))};
  }
#endif
};
inline D operator+(D a, D b) { return {a.lo + b.lo, a.hi + b.hi}; }
inline D operator*(D a, D b) { return {a.lo * b.lo, a.hi * b.hi}; }
inline D more(D c, D a, D b) { return {add_product(c.lo, a.lo, b.lo), add_product(c.hi, a.hi, b.hi)}; }    // c + a b
inline D less(D c, D a, D b) { return {take_product(c.lo, a.lo, b.lo), take_product(c.hi, a.hi, b.hi)}; }  // c - a b

#if HWY_TARGET == HWY_SCALAR
/// Two numbers.
struct P {
  static constexpr int kWidth = 2;
  F v[2];
  static P load(const float* at) { return {{F::load(at), F::load(at + 1)}}; }
  static P zero() { return {{F::zero(), F::zero()}}; }
  static P pair(const float* at) { return load(at); }
  void store(float* at) const {
    v[0].store(at);
    v[1].store(at + 1);
  }
};
inline P operator+(P a, P b) { return {{a.v[0] + b.v[0], a.v[1] + b.v[1]}}; }
inline P fma(P a, P b, P c) { return {{fma(a.v[0], b.v[0], c.v[0]), fma(a.v[1], b.v[1], c.v[1])}}; }
#else
using P = F;
#endif

constexpr int kVectors = F::kWidth == 16 ? 2 : F::kWidth == 8 ? 4 : 8, kHeldColumns = F::kWidth == 16 ? 8 : F::kWidth == 8 ? 3 : 1;
#include "runtime/synth/kernels_body.inl"
#include "runtime/synth/kernels_receiver.inl"

constexpr Isa kIsa = HWY_TARGET == HWY_AVX3   ? Isa::kAvx512
                     : HWY_TARGET == HWY_AVX2 ? Isa::kAvx2
                     : HWY_TARGET == HWY_SSE4 ? Isa::kSse4
                     : HWY_TARGET == HWY_NEON ? Isa::kNeon
                     : HWY_TARGET == HWY_WASM ? Isa::kSimd128
                                              : Isa::kPlain;

const Kernels& get_table() {
  static constexpr Kernels kKernels{kIsa,          advance,         emit,           ring,  strike,   drive,
                                    emit_weighted, strike_and_keep, drive_and_keep, weigh, convolve, read};
  return kKernels;
}

}  // namespace
}  // namespace carillon::synth::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::synth {

HWY_EXPORT(get_table);
const Kernels& get_kernels(Isa isa) noexcept { return base::choose(HWY_DISPATCH_TABLE(get_table), isa)(); }

}  // namespace carillon::synth
#endif

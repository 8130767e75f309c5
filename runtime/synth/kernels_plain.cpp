// Method:     one mode or sample at a time, for any processor; the compiler may take what it has.
// Deviations: no fused multiply-add, so that no library function is called for it.
#include "runtime/synth/kernels.hpp"

namespace carillon::synth {
namespace {

struct F {
  static constexpr int kWidth = 1;
  float v;
  static F load(const float* at) { return {*at}; }
  static F all(float x) { return {x}; }
  static F zero() { return {0.0F}; }
  static F convert(const std::int16_t* at) { return {static_cast<float>(*at)}; }
  void store(float* at) const { *at = v; }
  float sum() const { return v; }
  friend F operator+(F a, F b) { return {a.v + b.v}; }
  friend F operator-(F a, F b) { return {a.v - b.v}; }
  friend F operator*(F a, F b) { return {a.v * b.v}; }
  friend F operator/(F a, F b) { return {a.v / b.v}; }
};
inline F fma(F a, F b, F c) { return {a.v * b.v + c.v}; }
inline F less(F c, F a, F b) { return {c.v - a.v * b.v}; }  // c - a b

struct D {
  double v;
  static D load(const double* at) { return {*at}; }
  static D all(double x) { return {x}; }
  static D zero() { return {0.0}; }
  static D widen(F x) { return {static_cast<double>(x.v)}; }
  void store(double* at) const { *at = v; }
  F narrow() const { return {static_cast<float>(v)}; }
  friend D operator+(D a, D b) { return {a.v + b.v}; }
  friend D operator*(D a, D b) { return {a.v * b.v}; }
};
inline D more(D c, D a, D b) { return {c.v + a.v * b.v}; }  // c + a b
inline D less(D c, D a, D b) { return {c.v - a.v * b.v}; }  // c - a b

/// Two numbers.
struct P {
  static constexpr int kWidth = 2;
  float v[2];
  static P load(const float* at) { return {{at[0], at[1]}}; }
  static P zero() { return {{0.0F, 0.0F}}; }
  static P pair(const float* at) { return load(at); }
  void store(float* at) const { at[0] = v[0], at[1] = v[1]; }
};
inline P operator+(P a, P b) { return {{a.v[0] + b.v[0], a.v[1] + b.v[1]}}; }
inline P fma(P a, P b, P c) { return {{a.v[0] * b.v[0] + c.v[0], a.v[1] * b.v[1] + c.v[1]}}; }

constexpr int kVectors = 8, kHeldColumns = 1;
#include "runtime/synth/kernels_body.inl"
#include "runtime/synth/kernels_receiver.inl"

}  // namespace

const Kernels kPlainKernels{Isa::kPlain,   advance,         emit,           ring,  strike,   drive,
                            emit_weighted, strike_and_keep, drive_and_keep, weigh, convolve, read};

}  // namespace carillon::synth

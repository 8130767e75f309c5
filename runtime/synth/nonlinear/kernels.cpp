// Method:     long vectors, lanes along them, sums in as many registers as hide the latency of an addition. A matrix is passed over once
//             where that is possible: four of its rows are multiplied, squared and added while they are in the first cache.
//             A turn by three shears (Strachan's lifting): each has the determinant 1 to the last bit, so that its rounding turns an
//             ellipse a little and does not change its size.
// Source:     docs/equations.md E12.
#include "runtime/synth/nonlinear/kernels.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::nonlinear::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
const hn::ScalableTag<float> kFloats;
const hn::ScalableTag<double> kDoubles;
const hn::Rebind<float, decltype(kDoubles)> kNarrow;                     // as many floats as a vector of doubles has lanes
const hn::CappedTag<float, static_cast<std::size_t>(kColumnUnit)> kFew;  // columns of a triangle: no lanes beyond their padding
using F = hn::Vec<decltype(kFloats)>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kFloats)), kWide = static_cast<int>(hn::MaxLanes(kDoubles));

HWY_INLINE F load(const float* at) { return hn::LoadU(kFloats, at); }
HWY_INLINE hn::Vec<decltype(kDoubles)> load(const double* at) { return hn::LoadU(kDoubles, at); }
HWY_INLINE void store(F x, float* at) { hn::StoreU(x, kFloats, at); }
HWY_INLINE void store(hn::Vec<decltype(kDoubles)> x, double* at) { hn::StoreU(x, kDoubles, at); }
HWY_INLINE float add_up(F x) { return hn::GetLane(hn::SumOfLanes(kFloats, x)); }
HWY_INLINE double add_up(hn::Vec<decltype(kDoubles)> x) { return hn::GetLane(hn::SumOfLanes(kDoubles, x)); }
template <int kCount>
HWY_INLINE void clear(F (&sums)[kCount]) {
#pragma GCC unroll 16
  for (F& sum : sums) sum = hn::Zero(kFloats);
}

TurnSums turn(const TurnTable& table, int modes, double* re, double* im, float* q) noexcept {
  auto before = hn::Zero(kDoubles), speed = before, amplitude = before;
  for (int m = 0; m < modes; m += kWide) {
    auto x = load(re + m), y = load(im + m);
    const auto tilt = load(table.tilt + m), stiffness = load(table.stiffness + m), tangent = load(table.half_tangent + m);
    const auto keep = load(table.keep + m);
    auto v = hn::NegMulAdd(tilt, y, x);
    before = before + hn::MulAdd(v, v, stiffness * y * y);
    x = hn::NegMulAdd(tangent, y, x);
    y = hn::MulAdd(load(table.sine + m), x, y);
    x = hn::NegMulAdd(tangent, y, x) * keep;
    y = y * keep;
    store(x, re + m);
    store(y, im + m);
    v = hn::NegMulAdd(tilt, y, x);
    speed = hn::MulAdd(v, v, speed);
    amplitude = hn::MulAdd(stiffness * y, y, amplitude);
    hn::StoreU(hn::DemoteTo(kNarrow, load(table.to_q + m) * y), kNarrow, q + m);
  }
  return {add_up(before), add_up(speed), add_up(amplitude)};
}

GradientSums compare(int modes, const double* re, const double* im, const double* tilt, const double* restoring, const double* before,
                     const double* gradient) noexcept {
  auto speed = hn::Zero(kDoubles), speed_before = speed, square = speed, both = speed, back = speed;
  for (int m = 0; m < modes; m += kWide) {
    const auto g = load(gradient + m), y = load(im + m), v = hn::NegMulAdd(load(tilt + m), y, load(re + m)), p = load(before + m);
    speed = hn::MulAdd(v, g, speed);
    speed_before = hn::MulAdd(v, p, speed_before);
    square = hn::MulAdd(g, g, square);
    both = hn::MulAdd(g, p, both);
    back = hn::MulAdd(load(restoring + m) * y, g, back);
  }
  return {add_up(speed), add_up(speed_before), add_up(square), add_up(both), add_up(back)};
}

void kick(int modes, double half, const double* gradient, double* re, double* middle) noexcept {
  const auto part = hn::Set(kDoubles, half);
  for (int m = 0; m < modes; m += kWide) {
    const auto force = load(gradient + m), mid = hn::NegMulAdd(force, part, load(re + m));
    store(mid, middle + m);
    store(hn::NegMulAdd(force, part, mid), re + m);
  }
}

template <int kVectors>
HWY_INLINE void spread_tile(const float* columns, std::ptrdiff_t length, const float* x, int count, float* out) {
  F sum[kVectors];
  clear(sum);
  for (int j = 0; j < count; ++j) {
    const float* column = columns + j * length;
    const F factor = hn::Set(kFloats, x[j]);
#pragma GCC unroll 16
    for (int v = 0; v < kVectors; ++v) sum[v] = hn::MulAdd(factor, load(column + v * kLanes), sum[v]);
  }
#pragma GCC unroll 16
  for (int v = 0; v < kVectors; ++v) store(sum[v], out + v * kLanes);
}

void spread(const float* columns, std::ptrdiff_t length, const float* x, int count, float* out) noexcept {
  constexpr int kVectors = 8;
  std::ptrdiff_t at = 0;
  for (; at + kVectors * kLanes <= length; at += kVectors * kLanes) spread_tile<kVectors>(columns + at, length, x, count, out + at);
  for (; at < length; at += kUnit) spread_tile<kUnit / kLanes>(columns + at, length, x, count, out + at);
}

void gather(const float* columns, std::ptrdiff_t length, const float* x, int count, float* out) noexcept {
  int j = 0;
  for (; j + 4 <= count; j += 4) {
    const float* column = columns + j * length;
    F sum[4];
    clear(sum);
    for (std::ptrdiff_t at = 0; at < length; at += kLanes) {
      const F factor = load(x + at);
#pragma GCC unroll 4
      for (int c = 0; c < 4; ++c) sum[c] = hn::MulAdd(factor, load(column + c * length + at), sum[c]);
    }
#pragma GCC unroll 4
    for (int c = 0; c < 4; ++c) out[j + c] = add_up(sum[c]);
  }
  for (; j < count; ++j) {
    F sum = hn::Zero(kFloats);
    for (std::ptrdiff_t at = 0; at < length; at += kLanes) sum = hn::MulAdd(load(x + at), load(columns + j * length + at), sum);
    out[j] = add_up(sum);
  }
}

double square(const float* rows, std::ptrdiff_t stride, int length, int count, const float* x, float factor, const float* linear,
              float* eta, float* sum) noexcept {
  double energy = 0.0;
  for (int at = 0; at < length; at += kLanes) store(hn::Zero(kFloats), sum + at);
  for (int r = 0; r < count; r += kRowsAtOnce) {
    const float* row = rows + r * stride;
    F dot[kRowsAtOnce], weight[kRowsAtOnce];
    clear(dot);
    for (int at = 0; at < length; at += kLanes) {
      const F value = load(x + at);
#pragma GCC unroll 4
      for (int c = 0; c < kRowsAtOnce; ++c) dot[c] = hn::MulAdd(value, load(row + c * stride + at), dot[c]);
    }
#pragma GCC unroll 4
    for (int c = 0; c < kRowsAtOnce; ++c) {
      const float e = eta[r + c] = factor * add_up(dot[c]), l = linear[r + c];
      energy += static_cast<double>(e) * (static_cast<double>(l) + 0.5 * static_cast<double>(e));
      weight[c] = hn::Set(kFloats, l + e);
    }
    for (int at = 0; at < length; at += kLanes) {
      F value = load(sum + at);
#pragma GCC unroll 4
      for (int c = 0; c < kRowsAtOnce; ++c) value = hn::MulAdd(weight[c], load(row + c * stride + at), value);
      store(value, sum + at);
    }
  }
  return energy;
}

/// In vectors of the compiler, filled number by number: Highway's GatherIndex() takes 1.4 (AVX-512) and 2 (AVX2) times as long on Zen 5.
void sum_up(const std::int32_t* begin, int groups, const float* values, const std::int32_t* index, const float* x, float* out) noexcept {
  typedef float Filled __attribute__((vector_size(4 * kLanes)));
  constexpr int kVectors = kUnit / kLanes;
  for (int g = 0; g < groups; ++g) {
    Filled sum[kVectors] = {};
    for (std::ptrdiff_t e = begin[g]; e < begin[g + 1]; ++e) {
#pragma GCC unroll 16
      for (int v = 0; v < kVectors; ++v) {
        const std::ptrdiff_t at = kUnit * e + v * kLanes;
        Filled found{}, value;
#pragma GCC unroll 16
        for (int l = 0; l < kLanes; ++l) found[l] = x[index[at + l]];
        __builtin_memcpy(&value, values + at, sizeof value);
        sum[v] += found * value;
      }
    }
    __builtin_memcpy(out + kUnit * g, sum, sizeof sum);
  }
}

double weigh(int count, float factor, const float* linear, float* eta, float* weight) noexcept {
  auto energy = hn::Zero(kDoubles);
  for (int at = 0; at < count; at += kWide) {
    const auto e = hn::LoadU(kNarrow, eta + at) * hn::Set(kNarrow, factor), l = hn::LoadU(kNarrow, linear + at);
    hn::StoreU(e, kNarrow, eta + at);
    hn::StoreU(l + e, kNarrow, weight + at);
    const auto exact = hn::PromoteTo(kDoubles, e);
    energy = hn::MulAdd(exact, hn::MulAdd(hn::Set(kDoubles, 0.5), exact, hn::PromoteTo(kDoubles, l)), energy);
  }
  return add_up(energy);
}

void strain(int parts, int length, const float* gradient, float* out) noexcept {
  const int axes = parts / 3;
  for (int at = 0; at < length; at += kLanes) {
    const auto part = [&](int k, int a) HWY_ATTR { return load(gradient + (k * axes + a) * static_cast<std::ptrdiff_t>(length) + at); };
    F s[6];
    clear(s);
#pragma GCC unroll 3
    for (int k = 0; k < 3; ++k) {
      const F g0 = part(k, 0), g1 = part(k, 1);
      s[0] = hn::MulAdd(g0, g0, s[0]);
      s[1] = hn::MulAdd(g1, g1, s[1]);
      if (axes == 2) {
        s[2] = hn::MulAdd(g0, g1, s[2]);
      } else {
        const F g2 = part(k, 2);
        s[2] = hn::MulAdd(g2, g2, s[2]);
        s[3] = hn::MulAdd(g1, g2, s[3]);
        s[4] = hn::MulAdd(g0, g2, s[4]);
        s[5] = hn::MulAdd(g0, g1, s[5]);
      }
    }
#pragma GCC unroll 3
    for (int a = 0; a < 3; ++a)
      if (a < axes) s[a] = s[a] * hn::Set(kFloats, 0.5F);
#pragma GCC unroll 6
    for (int i = 0; i < 6; ++i)
      if (i < 3 || axes == 3) store(s[i], out + i * static_cast<std::ptrdiff_t>(length) + at);
  }
}

void pull_back(int parts, int length, const float* gradient, const float* pull, float* out) noexcept {
  const std::ptrdiff_t step = length;
  const int axes = parts / 3;
  for (int at = 0; at < length; at += kLanes) {
    F h[6];
#pragma GCC unroll 6
    for (int i = 0; i < 6; ++i) h[i] = i < 3 || axes == 3 ? load(pull + i * step + at) : hn::Zero(kFloats);
#pragma GCC unroll 3
    for (int k = 0; k < 3; ++k) {
      const float* from = gradient + k * axes * step + at;
      float* to = out + k * axes * step + at;
      const F g0 = load(from), g1 = load(from + step);
      if (axes == 2) {
        store(hn::MulAdd(h[2], g1, h[0] * g0), to);
        store(hn::MulAdd(h[1], g1, h[2] * g0), to + step);
      } else {
        const F g2 = load(from + 2 * step);
        store(hn::MulAdd(h[4], g2, hn::MulAdd(h[5], g1, h[0] * g0)), to);
        store(hn::MulAdd(h[3], g2, hn::MulAdd(h[1], g1, h[5] * g0)), to + step);
        store(hn::MulAdd(h[2], g2, hn::MulAdd(h[3], g1, h[4] * g0)), to + 2 * step);
      }
    }
  }
}

void multiply(int count, const float* q, float* pairs) noexcept {
  constexpr int kStep = static_cast<int>(hn::MaxLanes(kFew));
  for (int j = 0; j < count; ++j) {
    const auto factor = hn::Set(kFew, q[j]);
    for (int i = 0; i < (j / kColumnUnit + 1) * kColumnUnit; i += kStep, pairs += kStep)
      hn::StoreU(hn::LoadU(kFew, q + i) * factor, kFew, pairs);
  }
}

void apply(int count, const float* triangle, const float* q, float* out) noexcept {
  constexpr int kStep = static_cast<int>(hn::MaxLanes(kFew));
  for (int i = 0; i < count + kColumnUnit; ++i) out[i] = 0.0F;
  for (int j = 0; j < count; ++j) {
    const auto factor = hn::Set(kFew, q[j]);
    auto dot = hn::Zero(kFew);
    for (int i = 0; i < (j / kColumnUnit + 1) * kColumnUnit; i += kStep, triangle += kStep) {
      const auto entry = hn::LoadU(kFew, triangle);
      hn::StoreU(hn::MulAdd(entry, factor, hn::LoadU(kFew, out + i)), kFew, out + i);
      dot = hn::MulAdd(entry, hn::LoadU(kFew, q + i), dot);
    }
    out[j] += hn::GetLane(hn::SumOfLanes(kFew, dot));
  }
}

const CoupledKernels& get_table() {
  static constexpr CoupledKernels kKernels{turn, compare, kick, spread, gather, square, sum_up, weigh, strain, pull_back, multiply, apply};
  return kKernels;
}

}  // namespace
}  // namespace carillon::nonlinear::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::nonlinear {

HWY_EXPORT(get_table);
const CoupledKernels& get_kernels(base::Instructions best) noexcept { return base::choose(HWY_DISPATCH_TABLE(get_table), best)(); }

}  // namespace carillon::nonlinear
#endif

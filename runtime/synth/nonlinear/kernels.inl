// Method:     long vectors, lanes along them, sums in as many registers as hide the latency of an addition. A matrix is passed over once
//             where that is possible: four of its rows are multiplied, squared and added while they are in the first cache.
//             A turn by three shears (Strachan's lifting): each has the determinant 1 to the last bit, so that its rounding turns an
//             ellipse a little and does not change its size.
// Source:     docs/equations.md E12.
//
// Included by kernels_*.cpp. Nothing of the standard library's templates is called here: the linker would take one copy of them for all
// files, maybe one with instructions that the processor has not.
#include "runtime/synth/nonlinear/kernels.hpp"

namespace carillon::nonlinear {
namespace {

template <int kLanes>
struct Lanes {
  typedef float Float __attribute__((vector_size(4 * kLanes)));
  typedef double Double __attribute__((vector_size(4 * kLanes)));
  static constexpr int kDoubles = kLanes / 2;
  typedef float Narrow __attribute__((vector_size(2 * kLanes)));  // kDoubles of them

  [[gnu::always_inline]] static Float load(const float* at) noexcept {
    Float x;
    __builtin_memcpy(&x, at, sizeof x);
    return x;
  }
  [[gnu::always_inline]] static Double load(const double* at) noexcept {
    Double x;
    __builtin_memcpy(&x, at, sizeof x);
    return x;
  }
  template <typename Vector, typename Number>
  [[gnu::always_inline]] static void store(const Vector& x, Number* at) noexcept {
    __builtin_memcpy(at, &x, sizeof x);
  }
  template <typename Vector>
  [[gnu::always_inline]] static auto add_up(const Vector& x) noexcept {
    auto sum = x[0];
    for (int l = 1; l < static_cast<int>(sizeof(Vector) / sizeof(sum)); ++l) sum += x[l];
    return sum;
  }
  [[gnu::always_inline]] static float add_up_halves(const Float& x) noexcept {
    float lane[kLanes];
    __builtin_memcpy(lane, &x, sizeof x);
#pragma GCC unroll 8
    for (int step = kLanes / 2; step > 0; step /= 2)
      for (int l = 0; l < step; ++l) lane[l] += lane[l + step];
    return lane[0];
  }
};

template <int kLanes>
TurnSums turn(const TurnTable& table, int modes, double* re, double* im, float* q) noexcept {
  using L = Lanes<kLanes>;
  using D = typename L::Double;
  D before{}, speed{}, amplitude{};
  for (int m = 0; m < modes; m += L::kDoubles) {
    D x = L::load(re + m), y = L::load(im + m);
    const D tilt = L::load(table.tilt + m), stiffness = L::load(table.stiffness + m), tangent = L::load(table.half_tangent + m);
    const D keep = L::load(table.keep + m);
    D v = x - tilt * y;
    before += v * v + stiffness * y * y;
    x -= tangent * y;
    y += L::load(table.sine + m) * x;
    x -= tangent * y;
    x *= keep;
    y *= keep;
    L::store(x, re + m);
    L::store(y, im + m);
    v = x - tilt * y;
    speed += v * v;
    amplitude += stiffness * y * y;
    L::store(__builtin_convertvector(L::load(table.to_q + m) * y, typename L::Narrow), q + m);
  }
  return {L::add_up(before), L::add_up(speed), L::add_up(amplitude)};
}

template <int kLanes>
GradientSums compare(int modes, const double* re, const double* im, const double* tilt, const double* restoring, const double* before,
                     const double* gradient) noexcept {
  using L = Lanes<kLanes>;
  using D = typename L::Double;
  D speed{}, speed_before{}, square{}, both{}, back{};
  for (int m = 0; m < modes; m += L::kDoubles) {
    const D g = L::load(gradient + m), y = L::load(im + m), v = L::load(re + m) - L::load(tilt + m) * y, p = L::load(before + m);
    speed += v * g;
    speed_before += v * p;
    square += g * g;
    both += g * p;
    back += L::load(restoring + m) * y * g;
  }
  return {L::add_up(speed), L::add_up(speed_before), L::add_up(square), L::add_up(both), L::add_up(back)};
}

template <int kLanes>
void kick(int modes, double half, const double* gradient, double* re, double* middle) noexcept {
  using L = Lanes<kLanes>;
  for (int m = 0; m < modes; m += L::kDoubles) {
    const auto force = L::load(gradient + m) * half, mid = L::load(re + m) - force;
    L::store(mid, middle + m);
    L::store(mid - force, re + m);
  }
}

template <int kLanes, int kVectors>
[[gnu::always_inline]] inline void spread_tile(const float* columns, std::ptrdiff_t length, const float* x, int count,
                                               float* out) noexcept {
  using L = Lanes<kLanes>;
  typename L::Float sum[kVectors] = {};
  for (int j = 0; j < count; ++j) {
    const float* column = columns + j * length;
    const typename L::Float factor = x[j] - typename L::Float{};
#pragma GCC unroll 16
    for (int v = 0; v < kVectors; ++v) sum[v] += factor * L::load(column + v * kLanes);
  }
#pragma GCC unroll 16
  for (int v = 0; v < kVectors; ++v) L::store(sum[v], out + v * kLanes);
}

template <int kLanes, int kVectors>
void spread(const float* columns, std::ptrdiff_t length, const float* x, int count, float* out) noexcept {
  std::ptrdiff_t at = 0;
  for (; at + kVectors * kLanes <= length; at += kVectors * kLanes) spread_tile<kLanes, kVectors>(columns + at, length, x, count, out + at);
  for (; at < length; at += kUnit) spread_tile<kLanes, kUnit / kLanes>(columns + at, length, x, count, out + at);
}

template <int kLanes>
void gather(const float* columns, std::ptrdiff_t length, const float* x, int count, float* out) noexcept {
  using L = Lanes<kLanes>;
  using F = typename L::Float;
  int j = 0;
  for (; j + 4 <= count; j += 4) {
    const float* column = columns + j * length;
    F sum[4] = {};
    for (std::ptrdiff_t at = 0; at < length; at += kLanes) {
      const F factor = L::load(x + at);
#pragma GCC unroll 4
      for (int c = 0; c < 4; ++c) sum[c] += factor * L::load(column + c * length + at);
    }
    for (int c = 0; c < 4; ++c) out[j + c] = L::add_up_halves(sum[c]);
  }
  for (; j < count; ++j) {
    F sum{};
    for (std::ptrdiff_t at = 0; at < length; at += kLanes) sum += L::load(x + at) * L::load(columns + j * length + at);
    out[j] = L::add_up_halves(sum);
  }
}

template <int kLanes>
double square(const float* rows, std::ptrdiff_t stride, int length, int count, const float* x, float factor, const float* linear,
              float* eta, float* sum) noexcept {
  using L = Lanes<kLanes>;
  using F = typename L::Float;
  double energy = 0.0;
  for (int at = 0; at < length; at += kLanes) L::store(F{}, sum + at);
  for (int r = 0; r < count; r += kRowsAtOnce) {
    const float* row = rows + r * stride;
    F dot[kRowsAtOnce] = {};
    for (int at = 0; at < length; at += kLanes) {
      const F value = L::load(x + at);
#pragma GCC unroll 4
      for (int c = 0; c < kRowsAtOnce; ++c) dot[c] += value * L::load(row + c * stride + at);
    }
    F weight[kRowsAtOnce];
    for (int c = 0; c < kRowsAtOnce; ++c) {
      const float e = eta[r + c] = factor * L::add_up_halves(dot[c]), l = linear[r + c];
      energy += static_cast<double>(e) * (static_cast<double>(l) + 0.5 * static_cast<double>(e));
      weight[c] = (l + e) - F{};
    }
    for (int at = 0; at < length; at += kLanes) {
      F value = L::load(sum + at);
#pragma GCC unroll 4
      for (int c = 0; c < kRowsAtOnce; ++c) value += weight[c] * L::load(row + c * stride + at);
      L::store(value, sum + at);
    }
  }
  return energy;
}

template <int kLanes>
void sum_up(const std::int32_t* begin, int groups, const float* values, const std::int32_t* index, const float* x, float* out) noexcept {
  using L = Lanes<kLanes>;
  using F = typename L::Float;
  constexpr int kVectors = kUnit / kLanes;
  for (int g = 0; g < groups; ++g) {
    F sum[kVectors] = {};
    for (std::ptrdiff_t e = begin[g]; e < begin[g + 1]; ++e)
#pragma GCC unroll 4
      for (int v = 0; v < kVectors; ++v) {
        const std::int32_t* at = index + kUnit * e + v * kLanes;
        F found;
#pragma GCC unroll 16
        for (int l = 0; l < kLanes; ++l) found[l] = x[at[l]];
        sum[v] += found * L::load(values + kUnit * e + v * kLanes);
      }
    for (int v = 0; v < kVectors; ++v) L::store(sum[v], out + kUnit * g + v * kLanes);
  }
}

template <int kLanes>
double weigh(int count, float factor, const float* linear, float* eta, float* weight) noexcept {
  using L = Lanes<kLanes>;
  using D = typename L::Double;
  D energy{};
  for (int at = 0; at < count; at += L::kDoubles) {
    typename L::Narrow e, l;
    __builtin_memcpy(&e, eta + at, sizeof e);
    __builtin_memcpy(&l, linear + at, sizeof l);
    e *= factor;
    L::store(e, eta + at);
    L::store(l + e, weight + at);
    const D exact = __builtin_convertvector(e, D);
    energy += exact * (__builtin_convertvector(l, D) + 0.5 * exact);
  }
  return L::add_up(energy);
}

template <int kLanes>
void strain(int parts, int length, const float* gradient, float* out) noexcept {
  using L = Lanes<kLanes>;
  using F = typename L::Float;
  const int axes = parts / 3;
  for (int at = 0; at < length; at += kLanes) {
    const auto part = [&](int k, int a) { return L::load(gradient + (k * axes + a) * static_cast<std::ptrdiff_t>(length) + at); };
    F s[6] = {};
    for (int k = 0; k < 3; ++k) {
      const F g0 = part(k, 0), g1 = part(k, 1);
      s[0] += g0 * g0;
      s[1] += g1 * g1;
      if (axes == 2) {
        s[2] += g0 * g1;
      } else {
        const F g2 = part(k, 2);
        s[2] += g2 * g2;
        s[3] += g1 * g2;
        s[4] += g0 * g2;
        s[5] += g0 * g1;
      }
    }
    for (int a = 0; a < axes; ++a) s[a] *= 0.5F;
    for (int i = 0; i < (axes == 2 ? 3 : 6); ++i) L::store(s[i], out + i * static_cast<std::ptrdiff_t>(length) + at);
  }
}

template <int kLanes>
void pull_back(int parts, int length, const float* gradient, const float* pull, float* out) noexcept {
  using L = Lanes<kLanes>;
  using F = typename L::Float;
  const std::ptrdiff_t step = length;
  const int axes = parts / 3;
  for (int at = 0; at < length; at += kLanes) {
    F h[6] = {};
    for (int i = 0; i < (axes == 2 ? 3 : 6); ++i) h[i] = L::load(pull + i * step + at);
    for (int k = 0; k < 3; ++k) {
      const float* from = gradient + k * axes * step + at;
      float* to = out + k * axes * step + at;
      const F g0 = L::load(from), g1 = L::load(from + step);
      if (axes == 2) {
        L::store(h[0] * g0 + h[2] * g1, to);
        L::store(h[2] * g0 + h[1] * g1, to + step);
      } else {
        const F g2 = L::load(from + 2 * step);
        L::store(h[0] * g0 + h[5] * g1 + h[4] * g2, to);
        L::store(h[5] * g0 + h[1] * g1 + h[3] * g2, to + step);
        L::store(h[4] * g0 + h[3] * g1 + h[2] * g2, to + 2 * step);
      }
    }
  }
}

// Columns of a triangle are padded to kColumnUnit: no lanes beyond that.
template <int kLanes>
void multiply(int count, const float* q, float* pairs) noexcept {
  using L = Lanes<kLanes>;
  for (int j = 0; j < count; ++j)
    for (int i = 0; i < (j / kColumnUnit + 1) * kColumnUnit; i += kLanes, pairs += kLanes) L::store(L::load(q + i) * q[j], pairs);
}

template <int kLanes>
void apply(int count, const float* triangle, const float* q, float* out) noexcept {
  using L = Lanes<kLanes>;
  for (int i = 0; i < count + kColumnUnit; ++i) out[i] = 0.0F;
  for (int j = 0; j < count; ++j) {
    typename L::Float dot{};
    for (int i = 0; i < (j / kColumnUnit + 1) * kColumnUnit; i += kLanes, triangle += kLanes) {
      const auto entry = L::load(triangle);
      L::store(L::load(out + i) + entry * q[j], out + i);
      dot += entry * L::load(q + i);
    }
    out[j] += L::add_up_halves(dot);
  }
}

template <int kLanes, int kVectors>
constexpr CoupledKernels make_kernels() {
  constexpr int kNarrow = kLanes < kColumnUnit ? kLanes : kColumnUnit;
  return {turn<kLanes>,   compare<kLanes>, kick<kLanes>,   spread<kLanes, kVectors>, gather<kLanes>,    square<kLanes>,
          sum_up<kLanes>, weigh<kLanes>,   strain<kLanes>, pull_back<kLanes>,        multiply<kNarrow>, apply<kNarrow>};
}

}  // namespace
}  // namespace carillon::nonlinear

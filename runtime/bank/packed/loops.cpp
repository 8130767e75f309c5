#include "runtime/bank/packed/loops.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/bank/packed/rows.hpp"
#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::packed::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
const hn::ScalableTag<float> kFloats;
const hn::ScalableTag<std::int32_t> kInts;
constexpr std::size_t kLanes = hn::MaxLanes(kFloats);

// Vectors of doubles of the compiler: Highway 1.0 has none for WebAssembly.
constexpr int kWide = HWY_MAX_BYTES / sizeof(double);
typedef double Doubles __attribute__((vector_size(8 * kWide)));

constexpr double kPerDistance2 = 0.3 * 0.3, kLinear = 100.0, kNugget = 1e-4;

Doubles calc_root(Doubles x) {
  for (int i = 0; i < kWide; ++i) x[i] = std::sqrt(x[i]);
  return x;
}

/// kWide vertices at once.
void calc_group(const Place* centres, const Neighbours* neighbours, const Place* places, int count, Stencil* stencils) {
  constexpr std::size_t n = kNeighbours;
  Doubles x[n][3], h = {};
  for (std::size_t k = 0; k < n; ++k) {
    Doubles square = {};
    for (std::size_t c = 0; c < 3; ++c) {
      for (int i = 0; i < kWide; ++i) {
        const int v = std::min(i, count - 1);
        x[k][c][i] = places[neighbours[v][k]][c] - centres[v][c];
      }
      square += x[k][c] * x[k][c];
    }
    h += calc_root(square) / static_cast<double>(n);
  }
  for (int i = 0; i < kWide; ++i) h[i] = h[i] > 0.0 ? 1.0 / h[i] : 1.0;
  for (auto& row : x)
    for (Doubles& value : row) value *= h;

  Doubles a[n][n], b[4][n];  // a: the lower triangle
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      Doubles square = {}, product = {};
      for (std::size_t c = 0; c < 3; ++c) {
        const Doubles d = x[i][c] - x[j][c];
        square += d * d;
        product += x[i][c] * x[j][c];
      }
      a[i][j] = 1.0 / (1.0 + kPerDistance2 * square) + kLinear * (1.0 + product);
    }
    a[i][i] += kNugget;
    const Doubles q = 1.0 / (1.0 + kPerDistance2 * (x[i][0] * x[i][0] + x[i][1] * x[i][1] + x[i][2] * x[i][2]));
    b[0][i] = q + kLinear;
    for (std::size_t c = 0; c < 3; ++c) b[1 + c][i] = (2.0 * kPerDistance2 * q * q + kLinear) * x[i][c];
  }
  for (std::size_t j = 0; j < n; ++j) {  // Cholesky; the diagonal becomes its inverse
    for (std::size_t k = 0; k < j; ++k) a[j][j] -= a[j][k] * a[j][k];
    a[j][j] = 1.0 / calc_root(a[j][j]);
    for (std::size_t i = j + 1; i < n; ++i) {
      for (std::size_t k = 0; k < j; ++k) a[i][j] -= a[i][k] * a[j][k];
      a[i][j] *= a[j][j];
    }
  }
  for (auto& right : b) {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < i; ++k) right[i] -= a[i][k] * right[k];
      right[i] *= a[i][i];
    }
    for (std::size_t i = n; i-- > 0;) {
      for (std::size_t k = i + 1; k < n; ++k) right[i] -= a[k][i] * right[k];
      right[i] *= a[i][i];
    }
  }
  for (int i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < n; ++k) {
      stencils[i].value[k] = static_cast<float>(b[0][k][i]);
      for (std::size_t c = 0; c < 3; ++c) {
        stencils[i].gradient[c][k] = static_cast<float>(b[1 + c][k][i]);
        stencils[i].offset[c][k] = static_cast<float>(x[k][c][i]);
      }
    }
  }
}

void calc_stencils(const Place* centres, const Neighbours* neighbours, const Place* places, std::size_t count, Stencil* stencils) {
  for (std::size_t v = 0; v < count; v += kWide)
    calc_group(centres + v, neighbours + v, places, static_cast<int>(std::min<std::size_t>(kWide, count - v)), stencils + v);
}

void add_weighted(const float* const* rows, const float* weights, std::size_t width, float* row) {
  for (std::size_t i = 0; i < width; i += kRowUnit) {
    constexpr std::size_t kVectors = kRowUnit / kLanes;
    hn::Vec<decltype(kFloats)> sum[kVectors];
#pragma GCC unroll 4
    for (auto& one : sum) one = hn::Zero(kFloats);
#pragma GCC unroll 12
    for (std::size_t k = 0; k < kNeighbours; ++k) {
      const auto weight = hn::Set(kFloats, weights[k]);
#pragma GCC unroll 4
      for (std::size_t v = 0; v < kVectors; ++v) sum[v] = hn::MulAdd(weight, hn::LoadU(kFloats, rows[k] + i + v * kLanes), sum[v]);
    }
#pragma GCC unroll 4
    for (std::size_t v = 0; v < kVectors; ++v) hn::StoreU(sum[v], kFloats, row + i + v * kLanes);
  }
}

void find_nearest(const Near& near, const Place& place, int reach, Neighbours& found) {
  const int shift = std::max(reach - kReachBits, 0);
  alignas(64) std::int32_t keys[Near::kMost];
  const std::size_t whole = (near.count + kLanes - 1) / kLanes * kLanes;
  const auto load = [&](const std::array<std::int32_t, Near::kMost>& from, std::size_t i, std::int32_t origin)
                        HWY_ATTR { return hn::ShiftRightSame(hn::Load(kInts, from.data() + i) - hn::Set(kInts, origin), shift); };
  const auto count = hn::Set(kInts, static_cast<std::int32_t>(near.count)), far = hn::Set(kInts, std::numeric_limits<std::int32_t>::max());
  auto number = hn::Iota(kInts, 0);
  for (std::size_t i = 0; i < whole; i += kLanes) {
    const auto x = load(near.x, i, place[0]), y = load(near.y, i, place[1]), z = load(near.z, i, place[2]);
    const auto key = hn::Or(hn::ShiftLeft<7>(x * x + y * y + z * z), number);
    hn::Store(hn::IfThenElse(number < count, key, far), kInts, keys + i);
    number = number + hn::Set(kInts, kLanes);
  }
  // The rank of each key is the number of those below it.
  std::int32_t by_rank[Near::kMost];
  for (std::size_t i = 0; i < whole; i += kLanes) {
    const auto own = hn::Load(kInts, keys + i);
    auto rank = hn::Zero(kInts);
    for (std::size_t j = 0; j < near.count; ++j) rank = rank - hn::VecFromMask(kInts, hn::Set(kInts, keys[j]) < own);
    alignas(64) std::int32_t ranks[kLanes];
    hn::Store(rank, kInts, ranks);
    for (std::size_t lane = 0; lane < kLanes && i + lane < near.count; ++lane) by_rank[ranks[lane]] = near.vertex[i + lane];
  }
  std::copy_n(by_rank, kNeighbours, found.begin());
}

void calc_matrix(const Stencil& stencil, const float* gradient, const float* differences, Matrix& matrix) {
  for (std::size_t e = 0; e < 9; ++e) {
    const std::size_t to = e / 3, from = e % 3;
    float value = to == from ? 1.0F : 0.0F, g[3] = {gradient[e], gradient[9 + e], gradient[18 + e]};
    float own[kNeighbours] = {};
    if (differences != nullptr) {
      for (std::size_t k = 0; k < kNeighbours; ++k) own[k] = differences[9 * k + e];
      for (std::size_t k = 0; k < kNeighbours; ++k) {
        value -= own[k];
        for (std::size_t j = 0; j < 3; ++j) g[j] -= stencil.offset[j][k] * own[k];
      }
    }
    float* const weights = matrix.data() + (from * 3 + to) * kNeighbours;
    for (std::size_t k = 0; k < kNeighbours; ++k)
      weights[k] =
          own[k] + stencil.value[k] * value + stencil.gradient[0][k] * g[0] + stencil.gradient[1][k] * g[1] + stencil.gradient[2][k] * g[2];
  }
}

/// kVectors vectors of modes at `i`.
template <std::size_t kVectors>
void multiply_some(const float* const* rows, const float* matrix, std::size_t padded, std::size_t i, float* row) {
  hn::Vec<decltype(kFloats)> sum[3][kVectors];
#pragma GCC unroll 3
  for (auto& axis : sum) {
#pragma GCC unroll 4
    for (auto& one : axis) one = hn::Zero(kFloats);
  }
  for (std::size_t k = 0; k < kNeighbours; ++k) {
    const float* from = rows[k] + i;
#pragma GCC unroll 3
    for (std::size_t c = 0; c < 3; ++c, from += padded) {
      const float* const weight = matrix + 3 * c * kNeighbours + k;
#pragma GCC unroll 4
      for (std::size_t v = 0; v < kVectors; ++v) {
        const auto x = hn::LoadU(kFloats, from + v * kLanes);
#pragma GCC unroll 3
        for (std::size_t to = 0; to < 3; ++to) sum[to][v] = hn::MulAdd(hn::Set(kFloats, weight[to * kNeighbours]), x, sum[to][v]);
      }
    }
  }
#pragma GCC unroll 3
  for (std::size_t to = 0; to < 3; ++to) {
#pragma GCC unroll 4
    for (std::size_t v = 0; v < kVectors; ++v) hn::StoreU(sum[to][v], kFloats, row + to * padded + i + v * kLanes);
  }
}

void multiply(const float* const* rows, const float* matrix, std::size_t padded, float* row) {
  constexpr std::size_t kMany = kLanes == 16 ? 4 : kLanes == 8 ? 3 : 2;  // sums of three axes fit the registers
  std::size_t i = 0;
  for (; i + kMany * kLanes <= padded; i += kMany * kLanes) multiply_some<kMany>(rows, matrix, padded, i, row);
  for (; i < padded; i += kLanes) multiply_some<1>(rows, matrix, padded, i, row);
}

float calc_energy(const float* row, std::size_t width) {
  auto sums = hn::Zero(kFloats);
  for (std::size_t i = 0; i < width; i += kLanes) {
    const auto x = hn::LoadU(kFloats, row + i);
    sums = hn::MulAdd(x, x, sums);
  }
  return hn::GetLane(hn::SumOfLanes(kFloats, sums));
}

void round(const float* row, const float* factor, std::size_t padded, std::int16_t* shape) {
  const hn::Rebind<std::int16_t, decltype(kFloats)> shorts;
  const auto least = hn::Set(kFloats, -32767.0F), half = hn::Set(kFloats, 0.5F);
  constexpr std::size_t kPiece = 64;
  for (std::size_t begin = 0; begin < padded; begin += kPiece) {
    const std::size_t count = std::min(kPiece, padded - begin);
    std::int16_t steps[3][kPiece];
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < count; i += kLanes) {
        auto x = hn::LoadU(kFloats, row + c * padded + begin + i) * hn::LoadU(kFloats, factor + begin + i);
        x = hn::IfThenElseZero(x == x, x);  // of damaged coefficients
        x = hn::Max(x, least);              // the highest saturates
        hn::StoreU(hn::DemoteTo(shorts, hn::ConvertTo(kInts, x + hn::CopySign(half, x))), shorts, steps[c] + i);
      }
    }
    std::int16_t* const to = shape + 3 * begin;
    for (std::size_t i = 0; i < count; ++i) {
      to[3 * i] = steps[0][i];
      to[3 * i + 1] = steps[1][i];
      to[3 * i + 2] = steps[2][i];
    }
  }
}

const Loops& get_table() {
  static constexpr Loops kLoops{calc_stencils, find_nearest, calc_matrix, add_weighted, multiply, calc_energy, round};
  return kLoops;
}

}  // namespace
}  // namespace carillon::packed::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::packed {

HWY_EXPORT(get_table);
const Loops& find_loops(base::Instructions best) { return base::choose(HWY_DISPATCH_TABLE(get_table), best)(); }

}  // namespace carillon::packed
#endif

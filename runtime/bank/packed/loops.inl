// Vectors of kLanes floats (and half as many doubles) in every loop. The including source defines CARILLON_LANES.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "runtime/bank/packed/loops.hpp"
#include "runtime/bank/packed/rows.hpp"

namespace carillon::packed {
namespace {

constexpr double kPerDistance2 = 0.3 * 0.3, kLinear = 100.0, kNugget = 1e-4;

/// The loops of this instruction set.
struct Kernels {
  static constexpr int kLanes = CARILLON_LANES;
  typedef float Vector __attribute__((vector_size(4 * kLanes)));
  typedef std::int32_t Integers __attribute__((vector_size(4 * kLanes)));
  typedef std::int16_t Shorts __attribute__((vector_size(2 * kLanes)));
  static constexpr int kWide = kLanes / 2;
  typedef double Doubles __attribute__((vector_size(8 * kWide)));

  static Vector load(const float* from) {
    Vector vector;
    std::memcpy(&vector, from, sizeof vector);
    return vector;
  }
  static void store(float* to, const Vector& vector) { std::memcpy(to, &vector, sizeof vector); }

  static Doubles calc_root(Doubles x) {
    for (int i = 0; i < kWide; ++i) x[i] = std::sqrt(x[i]);
    return x;
  }

  /// kWide vertices at once.
  static void calc_group(const Place* centres, const Neighbours* neighbours, const Place* places, int count, Stencil* stencils) {
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

  static void calc_stencils(const Place* centres, const Neighbours* neighbours, const Place* places, std::size_t count, Stencil* stencils) {
    for (std::size_t v = 0; v < count; v += kWide)
      calc_group(centres + v, neighbours + v, places, static_cast<int>(std::min<std::size_t>(kWide, count - v)), stencils + v);
  }

  static void add_weighted(const float* const* rows, const float* weights, std::size_t width, float* row) {
    for (std::size_t i = 0; i < width; i += kRowUnit) {
      constexpr std::size_t kVectors = kRowUnit / kLanes;
      Vector sum[kVectors] = {};
#pragma GCC unroll 12
      for (std::size_t k = 0; k < kNeighbours; ++k) {
#pragma GCC unroll 4
        for (std::size_t v = 0; v < kVectors; ++v) sum[v] += weights[k] * load(rows[k] + i + v * kLanes);
      }
#pragma GCC unroll 4
      for (std::size_t v = 0; v < kVectors; ++v) store(row + i + v * kLanes, sum[v]);
    }
  }

  static void find_nearest(const Near& near, const Place& place, int reach, Neighbours& found) {
    const int shift = std::max(reach - kReachBits, 0);
    constexpr std::int32_t kFar = std::numeric_limits<std::int32_t>::max();
    Integers number;
    for (int i = 0; i < kLanes; ++i) number[i] = i;
    Integers keys[Near::kMost / kLanes];
    const std::size_t vectors = (near.count + kLanes - 1) / kLanes;
    for (std::size_t i = 0; i < vectors; ++i) {
      Integers x, y, z;
      std::memcpy(&x, near.x.data() + i * kLanes, sizeof x);
      std::memcpy(&y, near.y.data() + i * kLanes, sizeof y);
      std::memcpy(&z, near.z.data() + i * kLanes, sizeof z);
      x = (x - place[0]) >> shift;
      y = (y - place[1]) >> shift;
      z = (z - place[2]) >> shift;
      keys[i] = ((x * x + y * y + z * z) << 7) | number;
      number += kLanes;
    }
    for (std::size_t i = near.count; i < vectors * kLanes; ++i) keys[i / kLanes][static_cast<int>(i % kLanes)] = kFar;
    // The rank of each key is the number of those below it.
    std::int32_t by_rank[Near::kMost];
    for (std::size_t i = 0; i < vectors; ++i) {
      Integers rank = {};
      for (std::size_t j = 0; j < near.count; ++j) rank -= Integers{} + keys[j / kLanes][static_cast<int>(j % kLanes)] < keys[i];
      for (int lane = 0; lane < kLanes && i * kLanes + static_cast<std::size_t>(lane) < near.count; ++lane)
        by_rank[rank[lane]] = near.vertex[i * kLanes + static_cast<std::size_t>(lane)];
    }
    std::copy_n(by_rank, kNeighbours, found.begin());
  }

  static void calc_matrix(const Stencil& stencil, const float* gradient, const float* differences, Matrix& matrix) {
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
        weights[k] = own[k] + stencil.value[k] * value + stencil.gradient[0][k] * g[0] + stencil.gradient[1][k] * g[1] +
                     stencil.gradient[2][k] * g[2];
    }
  }

  /// kVectors vectors of modes at `i`.
  template <std::size_t kVectors>
  static void multiply_some(const float* const* rows, const float* matrix, std::size_t padded, std::size_t i, float* row) {
    Vector sum[3][kVectors] = {};
    for (std::size_t k = 0; k < kNeighbours; ++k) {
      const float* from = rows[k] + i;
#pragma GCC unroll 3
      for (std::size_t c = 0; c < 3; ++c, from += padded) {
        const float* const weight = matrix + 3 * c * kNeighbours + k;
#pragma GCC unroll 4
        for (std::size_t v = 0; v < kVectors; ++v) {
          const Vector x = load(from + v * kLanes);
#pragma GCC unroll 3
          for (std::size_t to = 0; to < 3; ++to) sum[to][v] += weight[to * kNeighbours] * x;
        }
      }
    }
#pragma GCC unroll 3
    for (std::size_t to = 0; to < 3; ++to) {
#pragma GCC unroll 4
      for (std::size_t v = 0; v < kVectors; ++v) store(row + to * padded + i + v * kLanes, sum[to][v]);
    }
  }

  static void multiply(const float* const* rows, const float* matrix, std::size_t padded, float* row) {
    constexpr std::size_t kMany = kLanes == 16 ? 4 : kLanes == 8 ? 3 : 2;  // sums of three axes fit the registers
    std::size_t i = 0;
    for (; i + kMany * kLanes <= padded; i += kMany * kLanes) multiply_some<kMany>(rows, matrix, padded, i, row);
    for (; i < padded; i += kLanes) multiply_some<1>(rows, matrix, padded, i, row);
  }

  static float calc_energy(const float* row, std::size_t width) {
    Vector sums = {};
    for (std::size_t i = 0; i < width; i += kLanes) {
      const Vector x = load(row + i);
      sums += x * x;
    }
    float sum = 0.0F;
    for (int i = 0; i < kLanes; ++i) sum += sums[i];
    return sum;
  }

  static void round(const float* row, const float* factor, std::size_t padded, std::int16_t* shape) {
    constexpr std::size_t kPiece = 64;
    for (std::size_t begin = 0; begin < padded; begin += kPiece) {
      const std::size_t count = std::min(kPiece, padded - begin);
      std::int16_t steps[3][kPiece];
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t i = 0; i < count; i += kLanes) {
          Vector x = load(row + c * padded + begin + i) * load(factor + begin + i);
          x = x == x ? x : Vector{};  // of damaged coefficients
          x = x > 32767.0F ? Vector{} + 32767.0F : x;
          x = x < -32767.0F ? Vector{} - 32767.0F : x;
          x += x < 0.0F ? Vector{} - 0.5F : Vector{} + 0.5F;
          const Shorts s = __builtin_convertvector(__builtin_convertvector(x, Integers), Shorts);
          std::memcpy(steps[c] + i, &s, sizeof s);
        }
      }
      std::int16_t* const to = shape + 3 * begin;
      const std::int16_t *const x = steps[0], *const y = steps[1], *const z = steps[2];
      for (std::size_t i = 0; i < count; ++i) {
        to[3 * i] = x[i];
        to[3 * i + 1] = y[i];
        to[3 * i + 2] = z[i];
      }
    }
  }

  static constexpr Loops kAll{calc_stencils, find_nearest, calc_matrix, add_weighted, multiply, calc_energy, round};
};

}  // namespace
}  // namespace carillon::packed

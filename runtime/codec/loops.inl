// Vectors of kLanes floats (and half as many doubles) in every loop. The including source defines CARILLON_LANES.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "runtime/codec/loops.hpp"
#include "runtime/codec/rows.hpp"

namespace carillon::codec {
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
        stencils[i].value[k] = b[0][k][i];
        for (std::size_t c = 0; c < 3; ++c) {
          stencils[i].gradient[c][k] = b[1 + c][k][i];
          stencils[i].offset[k][c] = x[k][c][i];
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

  static void multiply(const float* const* rows, const float* matrix, std::size_t padded, float* row) {
    constexpr std::size_t kVectors = kLanes == 4 ? 2 : 1;
    for (std::size_t i = 0; i < padded; i += kVectors * kLanes) {
      Vector sum[3][kVectors] = {};
      const float* weight = matrix;
      for (std::size_t k = 0; k < kNeighbours; ++k) {
        const float* from = rows[k] + i;
#pragma GCC unroll 3
        for (std::size_t c = 0; c < 3; ++c, from += padded, weight += 3) {
#pragma GCC unroll 2
          for (std::size_t v = 0; v < kVectors; ++v) {
            const Vector x = load(from + v * kLanes);
#pragma GCC unroll 3
            for (std::size_t to = 0; to < 3; ++to) sum[to][v] += weight[to] * x;
          }
        }
      }
#pragma GCC unroll 3
      for (std::size_t to = 0; to < 3; ++to) {
#pragma GCC unroll 2
        for (std::size_t v = 0; v < kVectors; ++v) store(row + to * padded + i + v * kLanes, sum[to][v]);
      }
    }
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
    for (std::size_t i = 0; i < padded; i += kLanes) {
      std::int16_t steps[3][kLanes];
      for (std::size_t c = 0; c < 3; ++c) {
        Vector x = load(row + c * padded + i) * load(factor + i);
        x = x == x ? x : Vector{};  // of damaged coefficients
        x = x > 32767.0F ? Vector{} + 32767.0F : x;
        x = x < -32767.0F ? Vector{} - 32767.0F : x;
        x += x < 0.0F ? Vector{} - 0.5F : Vector{} + 0.5F;
        const Shorts s = __builtin_convertvector(__builtin_convertvector(x, Integers), Shorts);
        std::memcpy(steps[c], &s, sizeof s);
      }
      std::int16_t* to = shape + 3 * i;
      for (int j = 0; j < kLanes; ++j, to += 3) {
        to[0] = steps[0][j];
        to[1] = steps[1][j];
        to[2] = steps[2][j];
      }
    }
  }

  static constexpr Loops kAll{calc_stencils, add_weighted, multiply, calc_energy, round};
};

}  // namespace
}  // namespace carillon::codec

// Inner loops of coupled modes, selected by instruction set at run time.
#pragma once

#include <cstddef>
#include <cstdint>

#include "runtime/base/instructions.hpp"

namespace carillon::nonlinear {

inline constexpr int kUnit = 16;       // floats: vector lengths are multiples of this, zero-padded
inline constexpr int kRowsAtOnce = 4;  // numbers of rows are multiples of this

/// Constants per mode, in arrays of a multiple of kUnit.
struct TurnTable {
  const double* half_tangent;  // tan(omega_d k / 2)
  const double* sine;          // sin(omega_d k)
  const double* keep;          // e^(-d k)
  const double* tilt;          // d / omega_d
  const double* stiffness;     // (omega / omega_d)^2
  const double* to_q;          // coupled modes: scaled q over im; 0 for others
};

/// Sums over modes, v = re - tilt im.
struct TurnSums {
  double before;     // v^2 + stiffness im^2 before the turn
  double speed;      // v^2 after the turn
  double amplitude;  // stiffness im^2 after the turn
};

/// Sums over coupled modes, G the present gradient and P that of the previous sample.
struct GradientSums {
  double speed_gradient;   // v G
  double speed_before;     // v P
  double square;           // G^2
  double gradient_before;  // G P
  double restoring;        // lambda q G
};

/// Kernels of one instruction set. [audio-thread]
struct CoupledKernels {
  /// Advances the states by one sample, and writes their scaled q: to_q im.
  TurnSums (*turn)(const TurnTable& table, int modes, double* re, double* im, float* q) noexcept;
  /// `restoring`: lambda / omega_d, so that restoring im is lambda q; `before`: gradient of the previous sample.
  GradientSums (*compare)(int modes, const double* re, const double* im, const double* tilt, const double* restoring, const double* before,
                          const double* gradient) noexcept;
  /// middle = re - half gradient, re -= 2 half gradient.
  void (*kick)(int modes, double half, const double* gradient, double* re, double* middle) noexcept;
  /// out = sum over j < count of x[j] column[j]; columns of `length`, contiguous.
  void (*spread)(const float* columns, std::ptrdiff_t length, const float* x, int count, float* out) noexcept;
  /// out[j] = column[j] . x.
  void (*gather)(const float* columns, std::ptrdiff_t length, const float* x, int count, float* out) noexcept;
  /// eta_r = factor row_r . x of `count` rows, sum = sum of (linear_r + eta_r) row_r; row stride `stride`, row length `length`. Returns the
  /// sum of linear_r eta_r + eta_r^2 / 2. `eta`: output.
  double (*square)(const float* rows, std::ptrdiff_t stride, int length, int count, const float* x, float factor, const float* linear,
                   float* eta, float* sum) noexcept;
  /// Sparse matrix, kUnit rows at once: out[kUnit g + l] = sum over e from begin[g] to begin[g + 1] of values[kUnit e + l] x[index[kUnit e
  /// + l]].
  void (*sum_up)(const std::int32_t* begin, int groups, const float* values, const std::int32_t* index, const float* x,
                 float* out) noexcept;
  /// eta *= factor, weight = linear + eta. Returns the sum of square(). count: a multiple of kUnit.
  double (*weigh)(int count, float factor, const float* linear, float* eta, float* weight) noexcept;
  /// Strains of `length` points from their gradients, and the adjoint: gradients pulled by strains weighted with `pull`; parts: 6 or 9.
  void (*strain)(int parts, int length, const float* gradient, float* strain) noexcept;
  void (*pull_back)(int parts, int length, const float* gradient, const float* pull, float* out) noexcept;
  /// Products q_j q_i, column j of an upper triangle by columns, each padded to kColumnUnit.
  void (*multiply)(int count, const float* q, float* pairs) noexcept;
  /// out = (M + M^T) q of an upper triangle M by columns.
  void (*apply)(int count, const float* triangle, const float* q, float* out) noexcept;
};

inline constexpr int kColumnUnit = 8;

/// Start of column j.
constexpr std::ptrdiff_t find_column(std::ptrdiff_t j) noexcept {
  const std::ptrdiff_t full = j / kColumnUnit, rest = j % kColumnUnit;
  return kColumnUnit * (kColumnUnit * full * (full + 1) / 2 + rest * (full + 1));
}

/// Kernels of the best supported instruction set up to `best`. Any thread.
const CoupledKernels& get_kernels(base::Instructions best = base::Instructions::kBest) noexcept;

}  // namespace carillon::nonlinear

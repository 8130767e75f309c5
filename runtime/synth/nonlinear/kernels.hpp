// The inner loops of coupled modes: one implementation for every instruction set, chosen when the modes are made.
#pragma once

#include <cstddef>
#include <cstdint>

namespace carillon::nonlinear {

inline constexpr int kUnit = 16;       // floats: lengths of vectors are multiples of this, and what pads them is 0
inline constexpr int kRowsAtOnce = 4;  // rows come in multiples of this

/// Of each mode, in arrays of a multiple of kUnit.
struct TurnTable {
  const double* half_tangent;  // tan(omega_d k / 2)
  const double* sine;          // sin(omega_d k)
  const double* keep;          // e^(-d k)
  const double* tilt;          // d / omega_d
  const double* stiffness;     // (omega / omega_d)^2
  const double* to_q;          // of coupled modes: scaled q over im; 0 of others
};

/// Sums over the modes, v = re - tilt im.
struct TurnSums {
  double before;     // v^2 + stiffness im^2 before the turn
  double speed;      // v^2 after it
  double amplitude;  // stiffness im^2 after it
};

/// Sums over the coupled modes, G the gradient now and P that of the sample before.
struct GradientSums {
  double speed_gradient;   // v G
  double speed_before;     // v P
  double square;           // G^2
  double gradient_before;  // G P
  double restoring;        // lambda q G
};

/// One instruction set. [audio-thread]
struct CoupledKernels {
  /// Turns the states by one sample, and gives their scaled q: to_q im.
  TurnSums (*turn)(const TurnTable& table, int modes, double* re, double* im, float* q) noexcept;
  /// `restoring`: lambda / omega_d, so that restoring im is lambda q; `before`: the gradient of the sample before.
  GradientSums (*compare)(int modes, const double* re, const double* im, const double* tilt, const double* restoring, const double* before,
                          const double* gradient) noexcept;
  /// middle = re - half gradient, re -= 2 half gradient.
  void (*kick)(int modes, double half, const double* gradient, double* re, double* middle) noexcept;
  /// out = sum over j < count of x[j] column[j], each of `length`, one behind the other.
  void (*spread)(const float* columns, std::ptrdiff_t length, const float* x, int count, float* out) noexcept;
  /// out[j] = column[j] . x.
  void (*gather)(const float* columns, std::ptrdiff_t length, const float* x, int count, float* out) noexcept;
  /// eta_r = factor row_r . x of `count` rows, sum = sum of (linear_r + eta_r) row_r; rows are `stride` apart and count up to `length`.
  /// Returns the sum of linear_r eta_r + eta_r^2 / 2. `eta`: where they are put.
  double (*square)(const float* rows, std::ptrdiff_t stride, int length, int count, const float* x, float factor, const float* linear,
                   float* eta, float* sum) noexcept;
  /// Of a matrix that is 0 almost everywhere, kUnit of its rows at once: out[kUnit g + l] = sum over e from begin[g] to begin[g + 1] of
  /// values[kUnit e + l] x[index[kUnit e + l]].
  void (*sum_up)(const std::int32_t* begin, int groups, const float* values, const std::int32_t* index, const float* x,
                 float* out) noexcept;
  /// eta is multiplied by `factor`, weight = linear + eta. Returns what square() does. count: a multiple of kUnit.
  double (*weigh)(int count, float factor, const float* linear, float* eta, float* weight) noexcept;
  /// Strains of `length` points from their gradients, and what strains that are pulled by `pull` pull of the gradients; parts: 6 or 9.
  void (*strain)(int parts, int length, const float* gradient, float* strain) noexcept;
  void (*pull_back)(int parts, int length, const float* gradient, const float* pull, float* out) noexcept;
  /// Column j of an upper triangle by columns, padded each to kColumnUnit: q_j q_i.
  void (*multiply)(int count, const float* q, float* pairs) noexcept;
  /// out = (M + M^T) q of an upper triangle M by columns.
  void (*apply)(int count, const float* triangle, const float* q, float* out) noexcept;
};

inline constexpr int kColumnUnit = 8;

/// Where column j begins.
constexpr std::ptrdiff_t find_column(std::ptrdiff_t j) noexcept {
  const std::ptrdiff_t full = j / kColumnUnit, rest = j % kColumnUnit;
  return kColumnUnit * (kColumnUnit * full * (full + 1) / 2 + rest * (full + 1));
}

extern const CoupledKernels kPlainKernels;
#if defined(__x86_64__)
extern const CoupledKernels kAvx2Kernels, kAvx512Kernels;
#endif

/// The best that this processor has. Any thread.
const CoupledKernels& get_kernels() noexcept;

}  // namespace carillon::nonlinear

// Radiation of modes as multipoles about the centre of a sphere around the body.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::bank {

/// Modes coupled by the air as sums of modes without air: phi'_i = sum of part_ij phi_j, with unit modal mass including the air,
/// part^T (1 + M_a) part = 1. M modes, K parts; docs/equations.md E10.
struct Mixing {
  std::vector<std::int32_t> count;   // (M) number of parts, at least one
  std::vector<std::int32_t> motion;  // (K) mode by mode, ascending in each: a mode j < M, or M + r for rigid motion r (mixing.hpp)
  std::vector<double> part;          // (K) amplitude of that motion

  bool is_empty() const { return count.empty(); }
};

/// Exterior pressure of each mode per unit modal velocity (q' = 1 m kg^1/2 / s), solved by boundary elements (precompute/air); time factor
/// e^{-i omega t}. On and outside the sphere, at distance r from its centre in direction d:
///   p(r, d) = sum over l <= order, |m| <= l of  a_lm  h_l(k r) / h_l(k R)  Y_lm(d),      k = 2 pi freq_hz / sound_speed_ms,  R = radius_m
/// h_l = j_l + i y_l: outgoing waves. Y_lm: real, orthonormal, index l^2 + l + m; docs/equations.md E10. M modes.
struct Multipoles {
  Vec3 centre_m{};         // smallest sphere around the radiating surface, mesh axes
  double radius_m = 0.0;   // R
  double nearest_m = 0.0;  // distance from the centre from which error_db holds; at least R
  double air_density_kg_m3 = 0.0;
  double sound_speed_ms = 0.0;
  std::vector<double> freq_hz;            // (M) undamped frequency in air, at which the air was solved
  std::vector<std::int32_t> order;        // (M) L, (L + 1)^2 coefficients each; 0 <= L <= kMaxOrder
  std::vector<double> scale;              // (M) Pa s m^-1 kg^-1/2 per step
  std::vector<std::int16_t> coefficient;  // (sum of (L + 1)^2, 2): real and imaginary part of a_lm in steps, mode by mode
  std::vector<double> decay_per_s;        // (M) decay by radiation
  std::vector<double> added_mass;         // (M) added mass of the air / modal mass
  // (M) rms pressure error over directions relative to the rms, from nearest_m outward: interpolation over k, truncation and rounding,
  // without the error of the surface mesh.
  std::vector<double> error_db;
  Mixing mixing;             // empty: no coupling; since 1.6
  std::string method;        // description: boundary elements, unknowns, wave numbers, half space
  bool is_in_decay = false;  // in memory only: Bank::decay_per_s includes decay_per_s (choose_frequencies())

  bool is_empty() const { return order.empty(); }
};

inline constexpr std::int32_t kMaxOrder = 120;

/// Coefficients of order L >= 0: (L + 1)^2.
constexpr std::size_t count_coefficients(std::int32_t order) noexcept {
  return (static_cast<std::size_t>(order) + 1) * (static_cast<std::size_t>(order) + 1);
}

/// |h_l(x)| for l = 0 .. order, (order + 1). x > 0; infinite on overflow. DLMF 10.51.1.
std::vector<double> calc_hankel_sizes(double x, std::int32_t order);

/// Radiation decay of a mode recomputed from its coefficients.
struct CoefficientDecay {
  double decay_per_s = 0.0;    // sum of |a_lm / h_l(k R)|^2 / (2 rho c k^2): power at q' = 1 over twice the energy 1/2
  double root_rounding = 0.0;  // [s^-1/2] bound of the rounding error of the root of the decay
};

/// For all modes (M), at freq_hz in the air of the multipoles. Orders must lie in 0 .. kMaxOrder and match the number of coefficients.
/// docs/equations.md E10.
std::vector<CoefficientDecay> calc_coefficient_decays(const Multipoles& multipoles);

/// True if the air was solved above a rigid plane. The field is then that of the body and its mirror image, and the body radiates half of
/// the power of the coefficients: the sum of all decays is half of theirs.
bool is_half_space(const Multipoles& multipoles);

/// Per mode (M): rms of the far field over the radiated directions, at 1 m, per unit modal velocity [Pa], from the radiation decay in the
/// air of the multipoles. In a half space the power is twice the square.
std::vector<double> calc_far_gains(const Multipoles& multipoles);

/// Appends order, scale and coefficients of a mode with coefficients a_lm [Pa s m^-1 kg^-1/2], (L + 1)^2 in the order l^2 + l + m: scale is
/// the largest component over 32767 (0 if all are 0), components are rounded to nearest. Other values are left to the caller. Throws
/// InputError for an order out of range, a wrong number of coefficients and non-finite ones.
void add_coefficients(Multipoles& multipoles, std::int32_t order, std::span<const std::complex<double>> coefficients);

/// Multipoles of the body with all lengths times g > 0: exact.
void scale_size(Multipoles& multipoles, double g);

/// Multipoles of the modes `chosen`, in that order; empty for none. A mixture loses the parts of unchosen modes and is normalised again to
/// unit modal mass with the recorded added mass.
Multipoles select_multipoles(const Multipoles& multipoles, const std::vector<std::size_t>& chosen);

}  // namespace carillon::bank

// What each mode sends into the air, as multipoles about the centre of a sphere around the body.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::bank {

/// The modes of a body that the air couples, as sums of its modes without air: mode i moves with phi'_i = sum of part_ij phi_j, and has
/// unit modal mass together with the air, part^T (1 + M_a) part = 1. M modes, K parts; docs/equations.md E10.
struct Mixing {
  std::vector<std::int32_t> count;   // (M) parts of the mode, at least one
  std::vector<std::int32_t> motion;  // (K) mode by mode, ascending in each: a mode j < M, or M + r for rigid motion r (mixing.hpp)
  std::vector<double> part;          // (K) of that motion

  bool is_empty() const { return count.empty(); }
};

/// The pressure outside the body that each mode makes, per unit modal velocity (q' = 1 m kg^1/2 / s), solved by boundary elements
/// (precompute/air). Signs of e^{-i omega t}. On and outside the sphere, at distance r from its centre in the direction d:
///   p(r, d) = sum over l <= order, |m| <= l of  a_lm  h_l(k r) / h_l(k R)  Y_lm(d),      k = 2 pi freq_hz / sound_speed_ms,  R = radius_m
/// h_l = j_l + i y_l: outgoing waves. Y_lm: real, orthonormal, number l^2 + l + m; docs/equations.md E10. M modes.
struct Multipoles {
  Vec3 centre_m{};         // of the smallest sphere around the surface that radiates, frame of the mesh
  double radius_m = 0.0;   // R
  double nearest_m = 0.0;  // from the centre: error_db is stated from there outward; at least R
  double air_density_kg_m3 = 0.0;
  double sound_speed_ms = 0.0;
  std::vector<double> freq_hz;            // (M) of the mode in air, undamped: what the air was solved at
  std::vector<std::int32_t> order;        // (M) L, (L + 1)^2 coefficients each; 0 <= L <= kMaxOrder
  std::vector<double> scale;              // (M) Pa s m^-1 kg^-1/2 per step
  std::vector<std::int16_t> coefficient;  // (sum of (L + 1)^2, 2): real and imaginary part of a_lm in steps, mode by mode
  std::vector<double> decay_per_s;        // (M) what radiation adds to the decay of the mode
  std::vector<double> added_mass;         // (M) of the air, over the modal mass
  std::vector<double> error_db;           // (M) of the pressure, rms over directions, relative to its rms, from nearest_m outward: what
                                          // interpolation over k, the order and rounding leave out; not the error of the surface mesh
  Mixing mixing;                          // or empty: the air does not couple the modes; since 1.6
  std::string method;                     // in words: boundary elements, unknowns, wave numbers, half space
  bool is_in_decay = false;               // in memory only: Bank::decay_per_s has decay_per_s in it (choose_frequencies())

  bool is_empty() const { return order.empty(); }
};

inline constexpr std::int32_t kMaxOrder = 120;

/// (L + 1)^2 of a mode of order L, 0 <= L.
constexpr std::size_t count_coefficients(std::int32_t order) noexcept {
  return (static_cast<std::size_t>(order) + 1) * (static_cast<std::size_t>(order) + 1);
}

/// |h_l(x)| for l = 0 .. order, (order + 1). 0 < x; infinite where a double does not hold it. DLMF 10.51.1.
std::vector<double> calc_hankel_sizes(double x, std::int32_t order);

/// What the coefficients of a mode say of its decay by radiation.
struct CoefficientDecay {
  double decay_per_s = 0.0;    // sum of |a_lm / h_l(k R)|^2 / (2 rho c k^2): the power at q' = 1, over twice the energy 1/2
  double root_rounding = 0.0;  // [s^-1/2] the root of the decay of the same coefficients before they were rounded is no further away
};

/// Of every mode (M), at freq_hz in the air of the multipoles. The orders lie in 0 .. kMaxOrder, and there are as many coefficients as they
/// ask for. docs/equations.md E10.
std::vector<CoefficientDecay> calc_coefficient_decays(const Multipoles& multipoles);

/// Whether the air was that above a rigid plane. Then the field is that of the body and its mirror image, and the body makes half of the
/// power that the coefficients carry: the sum of all decays is half of what they say.
bool is_half_space(const Multipoles& multipoles);

/// Of every mode (M), the root mean square of the far field over the directions into which it goes, taken back to 1 m, per unit modal
/// velocity [Pa]: of the decay by radiation, in the air of the multipoles. Into a half space as much power is twice the square.
std::vector<double> calc_far_gains(const Multipoles& multipoles);

/// Appends order, scale and coefficients of a mode with the coefficients a_lm [Pa s m^-1 kg^-1/2], (L + 1)^2 in the order l^2 + l + m: the
/// scale is the largest component over 32767, 0 where all are 0, and each is rounded to the nearest step. Its other values are left to the
/// caller. Throws InputError for an order out of range, another number of coefficients and one that is not finite.
void add_coefficients(Multipoles& multipoles, std::int32_t order, std::span<const std::complex<double>> coefficients);

/// The modes `chosen`, in that order. Nothing at all where none is chosen. Parts of modes that are not chosen are lost to a mixture; what
/// is left has unit modal mass again, with the added mass that is stated.
Multipoles select_multipoles(const Multipoles& multipoles, const std::vector<std::size_t>& chosen);

}  // namespace carillon::bank

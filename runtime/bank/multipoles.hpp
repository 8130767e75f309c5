// What each mode sends into the air, as multipoles about the centre of a sphere around the body.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::bank {

/// The pressure outside the body that each mode makes, per unit modal velocity (q' = 1 m kg^1/2 / s), solved by boundary elements
/// (precompute/radiation). Signs of e^{-i omega t}. On and outside the sphere, at distance r from its centre in the direction d:
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
  std::string method;                     // in words: boundary elements, unknowns, wave numbers, half space

  bool is_empty() const { return order.empty(); }
};

inline constexpr std::int32_t kMaxOrder = 120;

}  // namespace carillon::bank

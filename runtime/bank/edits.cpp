// Method:     K is linear in the Lame constants and M in the density; with all lengths times g, K grows with g and M with g^3. So with s,
// k, g
//             the scales of density, stiffness and size: lambda' = lambda k / (s g^2), phi' = phi / sqrt(s g^3). Of the radiation gain
//             the flow, the integral of |phi . n| over the surface, is proportional to phi' g^2; what depends on the frequency is written
//             anew.
// Source:     docs/equations.md E6, E7.
// Deviations: none.
#include "runtime/bank/edits.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "runtime/bank/surface.hpp"

namespace carillon::bank {
namespace {

void check(const Bank& bank, const Edits& edits) {
  for (const auto& [name, scale] :
       {std::pair{"density", edits.density_scale}, {"stiffness", edits.stiffness_scale}, {"size", edits.size_scale}}) {
    if (!(scale >= 1e-6 && scale <= 1e6))
      throw InputError(fmt::format("the scale of the {} is {}; it must lie within 1e-6 and 1e6", name, scale));
  }
  if (edits.alphas) {
    for (const double alpha : *edits.alphas) {
      if (!(alpha >= 0.0) || !std::isfinite(alpha))
        throw InputError(fmt::format("a damping of alpha {} is none; alphas are not negative", alpha));
    }
  }
  if (!bank.regions.empty() || bank.damping.law == "mixed") {
    throw InputError("the bank is of a body of several materials, which cannot be edited as one; compute the bank again");
  }
}

/// Radius of the sphere of the same outer area, as the radiation gains take it.
double calc_radius_m(const Bank& bank) {
  double twice = 0.0;
  for (const Triangle& triangle : find_outer_triangles(bank.vertices_m, bank.triangles)) {
    const Vec3 normal = calc_normal(bank.vertices_m, triangle);
    twice += std::hypot(normal[0], normal[1], normal[2]);
  }
  return std::sqrt(0.5 * twice / (4.0 * std::numbers::pi));
}

/// What the gain has of the frequency: omega / sqrt(1 + (k a)^2).
double calc_frequency_factor(double omega_rad_s, double radius_m) {
  const double ka = omega_rad_s / kSoundSpeedMs * radius_m;
  return omega_rad_s / std::sqrt(1.0 + ka * ka);
}

}  // namespace

Bank calc_edited(const Bank& bank, const Edits& edits) {
  check(bank, edits);
  const double s = edits.density_scale, k = edits.stiffness_scale, g = edits.size_scale;
  const double eigenvalue_scale = k / (s * g * g);
  const double shape_scale = 1.0 / std::sqrt(s * g * g * g);
  const double freq_scale = std::sqrt(eigenvalue_scale);
  const double radius = calc_radius_m(bank);
  Bank edited = bank;
  edited.material.young_modulus_pa *= k;
  edited.material.density_kg_m3 *= s;
  if (edits.alphas) {
    edited.damping = Damping{};
    edited.material.alpha1_s = (*edits.alphas)[0];
    edited.material.alpha2_per_s = (*edits.alphas)[1];
  }
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    edited.eigenvalue_rad2_s2[m] *= eigenvalue_scale;
    edited.decay_per_s[m] = calc_decay(edited.damping, edited.material, edited.eigenvalue_rad2_s2[m]);
    edited.shape_scale[m] *= shape_scale;
    edited.radiation_gain[m] *= shape_scale * g * g * calc_frequency_factor(std::sqrt(edited.eigenvalue_rad2_s2[m]), radius * g) /
                                calc_frequency_factor(std::sqrt(bank.eigenvalue_rad2_s2[m]), radius);
  }
  for (Vec3& vertex : edited.vertices_m) {
    for (double& x : vertex) x *= g;
  }
  edited.rigid.mass_kg *= s * g * g * g;
  edited.rigid.volume_m3 *= g * g * g;
  for (double& x : edited.rigid.centre_m) x *= g;
  for (double& x : edited.rigid.inertia_kg_m2) x *= s * std::pow(g, 5);
  for (double& freq : edited.band_hz) freq *= freq_scale;
  if (edited.proof) {
    for (double& cut : edited.proof->cut_hz) cut *= freq_scale;
  }
  edited.provenance = fmt::format(R"({{"edits": {{"density_scale": {}, "stiffness_scale": {}, "size_scale": {})", s, k, g);
  if (edits.alphas) edited.provenance += fmt::format(R"(, "alpha1_s": {}, "alpha2_per_s": {})", (*edits.alphas)[0], (*edits.alphas)[1]);
  edited.provenance += bank.provenance.empty() ? "}}" : fmt::format(R"(}}, "of": {}}})", bank.provenance);
  return edited;
}

}  // namespace carillon::bank

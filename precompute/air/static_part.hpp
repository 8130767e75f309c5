// What the midpoint rule misses of the static kernels 1 / 4 pi r near a facet: made once for a surface, whatever the wave number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/air/surface.hpp"

namespace carillon::air {

/// Midpoints nearer than this times the larger of their sizes take part in the plain rule with G - 1 / 4 pi r alone. No ratio of lengths in
/// a regular mesh.
inline constexpr float kNearPoints = 0.8123F;

/// The sparse rest of the static Galerkin integrals over pairs of facets that are near each other, exact minus the midpoint rule. N nodes,
/// n velocities. Rows have ascending columns and are the same for all three; (first[i] .. first[i + 1]) are those of node i.
struct StaticPart {
  std::vector<std::size_t> first;    // (N + 1)
  std::vector<std::int32_t> column;  // nodes
  std::vector<double> double_layer;  // of lambda_i lambda_j dG/dn_y [m^2]
  std::vector<double> normals;       // of lambda_i lambda_j n_x . n_y G [m^3]
  std::vector<double> curls;         // of curl_i . curl_j G [m]
  std::vector<double> single;        // (N, n) of lambda_i v G [m^3 times the unit of v]
  std::vector<double> adjoint;       // (N, n) of lambda_i v dG/dn_x

  std::size_t calc_bytes() const;
};

/// `velocity`: (T, 3, n) at the corners of each facet, linear between them. The inner integrals are in closed form, so that walls much
/// thinner than a facet are no harder than others.
StaticPart make_static_part(const RadiatingSurface& surface, std::span<const float> velocity, std::size_t count);

}  // namespace carillon::air

// Correction of the midpoint rule for the static kernels 1 / 4 pi r of near facets; independent of the wave number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/air/surface.hpp"
#include "precompute/comm/communicator.hpp"

namespace carillon::air {

/// Midpoints nearer than this times the larger of their sizes use G - 1 / 4 pi r in the midpoint rule. Chosen to equal no ratio of lengths
/// of a regular mesh.
inline constexpr float kNearPoints = 0.8123F;

/// Sparse correction of the static Galerkin integrals over near pairs of facets, exact minus midpoint rule: rows of N nodes, n velocities.
/// Rows have ascending columns, the same for all three matrices; (first[i] .. first[i + 1]): row i.
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

/// Rows of the nodes first_row .. last_row - 1. `velocity`: (T, 3, n) at the corners of each facet, linear between them. Inner integrals
/// are in closed form, so walls may be much thinner than a facet. A row has the same bits in every range.
StaticPart make_static_part(const RadiatingSurface& surface, std::span<const float> velocity, std::size_t count, std::size_t first_row,
                            std::size_t last_row);

/// Rows of all nodes, each integrated by one rank and known to all. Collective.
StaticPart share_static_part(const comm::Communicator& comm, const RadiatingSurface& surface, std::span<const float> velocity,
                             std::size_t count);

}  // namespace carillon::air

// Contact surfaces of bodies, with their penalty stiffness; clearance of points from rigid obstacles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/job/obstacles.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::transient {

using job::RigidObstacle;

/// Of a point: signed distance [m], positive outside, and unit normal towards the free side.
struct Clearance {
  double distance_m = 0;
  Vec3 normal{};
};

Clearance find_clearance(const RigidObstacle& obstacle, const Vec3& p);

/// A node of a contact surface.
struct TouchNode {
  std::int32_t node = 0;  // of the assembly
  std::int32_t body = 0;
  double stiffness_n_m = 0;  // penalty on this node: kappa E* A / l
  double reach_m = 0;        // a sheet: half its thickness, on both sides; a solid: 0
  Vec3 rest_m{};
};

/// Surfaces of all bodies, the same on every rank.
struct TouchSurface {
  std::vector<TouchNode> nodes;                        // ascending by node
  std::vector<std::array<std::int32_t, 3>> triangles;  // into nodes; of a solid counter-clockwise seen from outside
};

/// Penalty stiffness and other data of a surface's nodes, from its triangles (assembly numbers) and the modulus of each body's material.
/// kappa: docs/equations.md E11.
TouchSurface make_touch_surface(std::span<const Vec3> rest_m, std::span<const std::array<std::int32_t, 3>> triangles,
                                std::span<const std::int32_t> body_of_triangle, std::span<const double> modulus_pa,
                                std::span<const double> reach_m, double kappa);

}  // namespace carillon::transient

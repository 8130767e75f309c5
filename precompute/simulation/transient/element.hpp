// One tetrahedron at rest: gradients of its barycentric coordinates, weights, lumped mass, critical step. Scalar setup code. Internal
// header of carillon::transient.
#pragma once

#include <array>
#include <span>

#include "precompute/simulation/transient/quad.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::transient {

enum class Kind { kT4, kT10, kCurvedT10, kSheet };

inline int count_nodes(Kind kind) { return kind == Kind::kT4 ? 4 : kind == Kind::kSheet ? 9 : 10; }
inline int count_points(Kind kind) { return kind == Kind::kT4 ? 1 : 4; }

/// Shape data for forces and masses.
struct ElementShape {
  Kind kind = Kind::kT4;
  std::array<std::array<Vec3, 3>, 4> gradient{};  // (points, 3) of L1, L2, L3 [1/m]; T4 and straight T10: equal at all points
  std::array<double, 4> weight_m3{};              // (points)
  std::array<double, 10> lumped_m3{};             // (nodes) share of the volume; sums to it
};

/// Nodes in the order of mesh::TetMesh. False if the Jacobian is not positive at a quadrature point. Mass: T4 a quarter each; T10 Hinton,
/// Rock and Zienkiewicz 1976: straight ones 1/36 and 4/27.
[[nodiscard]] bool make_shape(Kind kind, std::span<const Vec3> x_m, ElementShape& shape);

/// True if mid nodes are off their edge midpoints by more than 1e-6 of the edge. x_m: (10).
bool is_curved(std::span<const Vec3> x_m);

/// Highest frequency [rad/s] of the element alone with its lumped mass, from 40 power iterations: low by some per cent at most.
double calc_omega(const ElementShape& shape, const Law& law);

}  // namespace carillon::transient

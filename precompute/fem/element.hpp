// Stiffness and mass of one tetrahedron, linear (T4) or quadratic (T10). Equations: docs/equations.md, elasticity.
#pragma once

#include <array>
#include <span>
#include <string>

#include "jobs/spec/job_spec.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::fem {

using mesh::Vec3;

inline constexpr int kMaxNodes = 10;

/// Matrices of one element with n nodes (4 or 10). Degrees of freedom node by node: x, y, z of node 0, then of node 1, ...
struct ElementMatrices {
  int nodes = 0;
  std::array<double, 9 * kMaxNodes * kMaxNodes> stiffness{};  // (3n, 3n) row-major [N/m], symmetric
  std::array<double, kMaxNodes * kMaxNodes> mass{};           // (n, n) row-major [kg], the same for x, y and z; diagonal when lumped
};

/// Integrals of density over one element: what a rigid body needs.
struct ElementMoments {
  double volume_m3 = 0.0;
  double mass_kg = 0.0;
  Vec3 first_kg_m{};                     // integral rho x
  std::array<double, 9> second_kg_m2{};  // (3, 3) integral rho x x^T
};

/// Calculates K and M of the element with node positions x, (4) or (10) in the order of mesh::TetMesh. Mid-side nodes are used where they
/// are (isoparametric); a straight-sided T10 is integrated exactly, a curved one by rules of degree 5 (K) and 7 (M).
/// T4: OSG02 eqs. 12 (corrected: + vol), 14, 15; T10: the same strain energy, HRZ lumping (Hinton, Rock and Zienkiewicz 1976).
/// Returns false, with `out` unusable, when the Jacobian is not positive at every integration point and node. Not collective.
[[nodiscard]] bool calc_element(std::span<const Vec3> x, const spec::Material& material, spec::Mass mass, ElementMatrices& out);

/// Calculates the moments of the element; exact for straight and curved T10. Not collective.
ElementMoments calc_moments(std::span<const Vec3> x, double density_kg_m3);

}  // namespace carillon::fem

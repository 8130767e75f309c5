// Stiffness and mass of one tetrahedron, linear (T4) or quadratic (T10). Equations: docs/equations.md, elasticity.
#pragma once

#include <array>
#include <span>

#include "precompute/fem/quadrature.hpp"
#include "precompute/job/job_spec.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::fem {

/// Matrices of one element with n nodes (4 or 10). Degrees of freedom node by node: x, y, z of node 0, then of node 1, ...
struct ElementMatrices {
  int nodes = 0;
  std::array<double, 9 * kMaxNodes * kMaxNodes> stiffness{};  // (3n, 3n) row-major [N/m], symmetric
  std::array<double, kMaxNodes * kMaxNodes> mass{};           // (n, n) row-major [kg], the same for x, y and z; diagonal when lumped
};

/// Integrals of the density over one element.
struct ElementMoments {
  double volume_m3 = 0.0;
  double mass_kg = 0.0;
  Vec3 first_kg_m{};                     // integral rho x
  std::array<double, 9> second_kg_m2{};  // (3, 3) integral rho x x^T
};

/// Only the mean dilatation of a T10 meets the part of lambda above this many mu; see docs/elements.md. Poisson ratios up to
/// kMaxDisplacementLambda / (2 (kMaxDisplacementLambda + 1)) = 0.4545 are unaffected.
inline constexpr double kMaxDisplacementLambda = 10.0;

/// Modulus of the mean dilatation of a T10 [Pa]: the part of the bulk modulus (Reuss average) above (kMaxDisplacementLambda + 2/3) times
/// the shear modulus (Voigt average), for an isotropic solid lambda - kMaxDisplacementLambda mu; 0 if negative. C less this part in every
/// normal pair stays positive definite.
double calc_mean_dilatation_modulus_pa(const material::Elasticity& elasticity_pa);

/// Material in the form used by the elements, made once for many elements.
struct Solid {
  /// full: no mean dilatation; standard displacement form even near incompressibility.
  Solid(const material::Material& material, bool full = false);  // NOLINT(google-explicit-constructor): a material is a solid

  bool isotropic = true;
  double displacement_lambda_pa = 0.0;      // of isotropic solids: acts on all of the dilatation in a T10;
  double mean_dilatation_modulus_pa = 0.0;  // of all solids: acts on its mean over the element only
  double lame_mu_pa = 0.0;
  double density_kg_m3 = 0.0;
  std::array<double, 81>
      tensor_pa{};  // C_rbcd at 27 r + 9 c + 3 b + d: stress_rb from strain_cd, less mean_dilatation_modulus_pa; of anisotropic ones
};

/// True if every mid-side node of a T10, nodes x (10), is within 1e-6 of the edge's length from its middle, like mesh::is_curved. Not
/// collective.
bool is_straight(std::span<const Vec3> x);

/// Calculates K and M of the element with node positions x, (4) or (10) in the order of mesh::TetMesh. Isoparametric, unless all mid-side
/// nodes lie within 1e-6 of an edge's length from the middle. Straight T10 are integrated exactly; curved ones have an exact mass and a
/// stiffness of degree 5.
/// T4: OSG02 eqs. 12 (corrected: + vol), 14, 15; T10: the same strain energy, HRZ lumping (Hinton, Rock and Zienkiewicz 1976). Nearly
/// incompressible T10: mean dilatation, Solid::mean_dilatation_modulus_pa.
/// Returns false, with `out` unusable, when the Jacobian is not positive at every node and integration point of the stiffness (a subset of
/// the points of mesh::is_folded). Not collective.
[[nodiscard]] bool calc_element(std::span<const Vec3> x, const Solid& solid, job::Mass mass, ElementMatrices& out);

/// Calculates the moments of the element; exact for straight and curved T10. Not collective.
ElementMoments calc_moments(std::span<const Vec3> x, double density_kg_m3);

}  // namespace carillon::fem

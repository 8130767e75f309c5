// Error estimate of one mode, and its dependence on the mesh size.
#pragma once

#include <cstdint>

namespace carillon::error_bars {

/// Kinds of mesh by convergence rate.
enum class Kind : std::uint8_t {
  kT4,         // interpolation h^2, lumping h^2, geometry h^2
  kT10,        // straight sides: interpolation h^4, lumping h^2, geometry h^2
  kT10Curved,  // mid nodes on the surface: interpolation h^4, lumping h^2, geometry h^4
};

/// Parts of an eigenvalue's error relative to it, without safety factors.
struct ErrorParts {
  double interpolation = 0.0;   // energy of the unresolved stress, lambda_h - lambda > 0
  double singular = 0.0;        // its part from elements at inward edges and at rims of fixed faces
  double bent = 0.0;            // its part times the squared curvature rise over the height of the elements (Surface::bend)
  double tractions = 0.0;       // its part from tractions left on free faces
  double energy = 0.0;          // of the whole mode as summed by the estimate: 1 (0.99 for curved T10)
  double lumping = 0.0;         // of a lumped mass: lambda (consistent) - lambda (lumped)
  double geometry = 0.0;        // lambda (smooth surface) - lambda (surface of the mesh), signed
  double geometry_noise = 0.0;  // uncertainty of `geometry`, >= 0
  double doubt = 0.0;           // lambda (alternative surface, TetMesh::doubt_m) - lambda; independent of the mesh size
  double doubt_noise = 0.0;
};

/// Power of the edge length in errors at inward edges. lambda at an edge where stress grows with r^(alpha - 1) is off by h^(2 alpha):
/// around 270 degrees alpha is 0.54 (opening), 2/3 (tearing) and 0.91 (shear), at a fixed face of a free body 0.71.
inline constexpr double kSingularOrder = 4.0 / 3;

/// Power of the edge length in interpolation errors of smooth modes: 2 for T4, 4 for T10.
double find_order(Kind kind);

/// Predicts the parts on a mesh with edges `edge_ratio` times as long. order: of interpolation away from singular edges, find_order() or
/// measured. Pure.
ErrorParts predict_parts(const ErrorParts& parts, Kind kind, double order, double edge_ratio);

/// Excess of lambda due to the elements; for T10 including the undetectable part of strongly curved elements in a thin wall. Pure.
double calc_excess(const ErrorParts& parts, Kind kind);

/// Bound [cents] on the frequency difference between the mesh and the body with the meshed surface, with safety factors. Pure.
double calc_cents(const ErrorParts& parts, Kind kind);

/// Bound [cents] on the frequency difference between that body and the one with the alternative surface, with safety factors; 0 without
/// doubt. Pure.
double calc_facet_cents(const ErrorParts& parts);

}  // namespace carillon::error_bars

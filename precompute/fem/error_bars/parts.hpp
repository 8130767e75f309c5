// The estimate of the error of one mode, and how it changes with the mesh.
#pragma once

#include <cstdint>

namespace carillon::error_bars {

/// The kinds of mesh whose errors fall at different rates.
enum class Kind : std::uint8_t {
  kT4,         // interpolation h^2, lumping h^2, geometry h^2
  kT10,        // straight sides: interpolation h^4, lumping h^2, geometry h^2
  kT10Curved,  // mid nodes on the surface: interpolation h^4, lumping h^2, geometry h^4
};

/// The parts of the error of one eigenvalue as shares of it, without safety factors.
struct ErrorParts {
  double interpolation = 0.0;   // energy of the stress that the elements cannot represent, lambda_h - lambda > 0
  double singular = 0.0;        // its part from elements at inward edges and at rims of fixed faces
  double bent = 0.0;            // of it, times the square of how far elements bend with the surface against their height (Surface::bend)
  double energy = 0.0;          // of the whole mode as the estimate sums it: 1 (0.99 for curved T10)
  double lumping = 0.0;         // of a lumped mass: lambda (consistent) - lambda (lumped)
  double geometry = 0.0;        // lambda (smooth surface) - lambda (surface of the mesh), signed
  double geometry_noise = 0.0;  // how uncertain `geometry` is, >= 0
  double doubt = 0.0;           // lambda (the other surface that the body may have, TetMesh::doubt_m) - lambda; no mesh makes it smaller
  double doubt_noise = 0.0;
};

/// The power of the edges by which interpolation errors of smooth modes fall: 2 for T4, 4 for T10.
double find_order(Kind kind);

/// Predicts the parts on a mesh whose edges are `edge_ratio` times as long. order: of interpolation, find_order() or what was measured.
/// Smooth modes; a fixed face with its singular rim converges slower, which the safety factor covers for ratios down to about 1/4. Pure.
ErrorParts predict_parts(const ErrorParts& parts, Kind kind, double order, double edge_ratio);

/// The excess of lambda by the elements; for T10 with the part that recovery cannot detect where they are strongly curved in a thin wall.
/// Pure.
double calc_excess(const ErrorParts& parts, Kind kind);

/// Bound [cents] on the difference between the frequencies of the mesh and of the body with the meshed surface, safety factors included.
/// Pure.
double calc_cents(const ErrorParts& parts, Kind kind);

/// Bound [cents] on the difference between that body and the one with the other surface, safety factors included; 0 without doubt. Pure.
double calc_facet_cents(const ErrorParts& parts);

}  // namespace carillon::error_bars

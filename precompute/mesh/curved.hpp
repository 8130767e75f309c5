// Quadratic map of a T10 with curved edges: Jacobian, and straightening of folded elements. Std only.
#pragma once

#include <cstdint>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

/// Midpoint of the ends of local edge `edge` of element e.
Vec3 calc_middle(const TetMesh& mesh, std::int64_t e, std::size_t edge);

/// True if a mid node of the element is off its edge's midpoint by more than 1e-6 of the edge length.
bool is_curved(const TetMesh& mesh, std::int64_t e);

/// det(dx / dxi) [m^3] of the quadratic map at barycentric coordinates L; six times the volume of a straight element.
double calc_jacobian(const TetMesh& mesh, std::int64_t e, const std::array<double, 4>& L);

/// True if the Jacobian is not positive at a node or at a quadrature point of the solver: 4 and 11 points (volume), 14 (stiffness), 125
/// (mass).
bool is_folded(const TetMesh& mesh, std::int64_t e);

/// Volume [m^3] of a quadratic element by the 11-point rule (exact).
double calc_curved_volume(const TetMesh& mesh, std::int64_t e);

/// Moves every mid node to the midpoint of its edge.
void straighten(TetMesh& mesh);

/// Moves mid nodes of folded elements to the edge midpoints, in all elements that share them, until no element is folded. Returns the
/// number of straightened elements. Pre: corners positively oriented.
std::int64_t straighten_folded_elements(TetMesh& mesh);

}  // namespace carillon::mesh

// The quadratic map of a T10 with curved edges: its Jacobian, and what is done where it folds over. Std only.
#pragma once

#include <cstdint>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

/// The point in the middle between the two ends of local edge `edge` of element e.
Vec3 calc_middle(const TetMesh& mesh, std::int64_t e, std::size_t edge);

/// True if a mid node of the quadratic element lies off the middle of its edge by more than 1e-6 of the edge's length.
bool is_curved(const TetMesh& mesh, std::int64_t e);

/// det(dx / dxi) [m^3] of the quadratic map at barycentric coordinates L; six times the volume where the element is straight.
double calc_jacobian(const TetMesh& mesh, std::int64_t e, const std::array<double, 4>& L);

/// True if the Jacobian of the quadratic element is not positive at a point where anything here evaluates it: the ten nodes, the rules of
/// 4 and 11 points (volume), of 14 (stiffness) and of 125 points (mass).
bool is_folded(const TetMesh& mesh, std::int64_t e);

/// Volume [m^3] of a quadratic element, by the rule of 11 points, which is exact.
double calc_curved_volume(const TetMesh& mesh, std::int64_t e);

/// Moves every mid node to the middle of its edge.
void straighten(TetMesh& mesh);

/// Moves the mid nodes of folded elements to the middles of their edges, which their neighbours follow, until no element is folded.
/// Returns how many elements were made straight. Pre: corners positively oriented.
std::int64_t straighten_folded_elements(TetMesh& mesh);

}  // namespace carillon::mesh

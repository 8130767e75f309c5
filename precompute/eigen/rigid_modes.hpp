// Rigid modes in closed form per connected component.
#pragma once

#include <vector>

#include "precompute/eigen/types.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// Rigid modes of the bodies in `nodes`: per component the combinations of three translations and three rotations that vanish at its fixed
/// nodes, M-orthonormal. A free body has six, one fixed at a point three, on a line one; a body whose free nodes lie on a line has no
/// rotation about it. per_component: number of modes of each component. Collective. Throws SolveError if K does not vanish on them: layout
/// and stiffness are not of the same body.
std::vector<petsc::VecHandle> make_rigid_modes(const la::Pencil& pencil, const NodeLayout& nodes, std::vector<std::int64_t>& per_component);

}  // namespace carillon::eigen

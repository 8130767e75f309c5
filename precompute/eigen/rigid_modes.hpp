// The motions that deform nothing, in closed form per connected component.
#pragma once

#include <vector>

#include "precompute/eigen/types.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// The rigid modes of the bodies in `nodes`: per component the combinations of three translations and three rotations that vanish at its
/// fixed nodes, M-orthonormal. A free body gives six, one fixed at a point three, on a line one; a body whose free nodes lie on a line
/// gives no rotation about it. per_component: how many belong to each. Collective. Throws SolveError when K does not vanish on them: then
/// layout and stiffness are not of the same body.
std::vector<petsc::VecHandle> make_rigid_modes(const la::Pencil& pencil, const NodeLayout& nodes, std::vector<std::int64_t>& per_component);

}  // namespace carillon::eigen

// The sharp edges of a surface's inward offset.
#pragma once

#include <vector>

#include "precompute/mesher/nearest.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Where the planes next to the sharp `curves` of the surface meet again after both moved inward by `wall_m`: the sharp edges of the
/// inner skin of a shell. Pieces that do not lie at that distance from the surface (at concave edges, where the offset is
/// round; where the wall of another side cuts them off) are left out. Points are about `spacing_m` apart.
std::vector<Polyline> make_inset_curves(const TriangleSurface& surface, const std::vector<Polyline>& curves, const NearestPoint& nearest,
                                        double wall_m, double spacing_m);

}  // namespace carillon::mesher

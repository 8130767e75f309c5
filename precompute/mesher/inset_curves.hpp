// Sharp edges of a surface's inward offset.
#pragma once

#include <vector>

#include "precompute/mesher/nearest.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Sharp edges of a shell's inner skin: intersections of the planes next to the sharp `curves` after moving inward by `wall_m`. Pieces at
/// another distance from the surface (concave edges, where the offset is round; pieces cut off by another side's wall) are omitted. Points
/// are about `spacing_m` apart.
std::vector<Polyline> make_inset_curves(const TriangleSurface& surface, const std::vector<Polyline>& curves, const NearestPoint& nearest,
                                        double wall_m, double spacing_m);

}  // namespace carillon::mesher

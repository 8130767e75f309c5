// The smooth surface through the corners of a triangle surface.
#pragma once

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// A finer triangle surface, its new points on curved patches through the points of `surface`: a faceted ball becomes a ball. Edges that
/// turn by more than `sharp_angle_deg` stay edges (curved along themselves), flat faces stay flat. Fine enough that hardly a triangle
/// bulges by more than tolerance_m, and at most 100,000 triangles; `surface` itself, and 1 in `pieces`, if it is that fine already.
/// pieces: into how many each edge was cut.
TriangleSurface round_surface(const TriangleSurface& surface, double sharp_angle_deg, double tolerance_m, int& pieces);

}  // namespace carillon::mesher

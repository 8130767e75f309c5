// The repairs of a triangle surface that CGAL does for us; std only, CGAL stays in repair.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Triangles of least area over a closed polygon, as indices into it, in the polygon's own sense of rotation. Empty if there are none
/// or the polygon has more than 1500 corners.
std::vector<Triangle> fill_polygon(const Polyline& polygon);

/// True if the surface is a 2-manifold, encloses a volume and no two of its triangles intersect.
bool is_clean(const TriangleSurface& surface);

/// Of a surface that is a manifold (else twice the first): the first two triangles that intersect, but in corners they share; or nothing.
std::optional<std::array<std::int32_t, 2>> find_crossing(const TriangleSurface& surface);

/// A closed manifold at the distance `offset_m` around a heap of triangles, which enters no gap narrower than `alpha_m`.
TriangleSurface wrap(const TriangleSurface& surface, double alpha_m, double offset_m);

}  // namespace carillon::mesher

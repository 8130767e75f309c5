// Repairs of a triangle surface by CGAL; std only, CGAL is confined to repair.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Least-area triangulation of a closed polygon, as indices into it, in the polygon's orientation. Empty if there is none, or above 1500
/// corners.
std::vector<Triangle> fill_polygon(const Polyline& polygon);

/// True for a 2-manifold without intersecting triangles that encloses a volume.
bool is_clean(const TriangleSurface& surface);

/// First two triangles that intersect other than in common corners; empty if none; twice the first if not a manifold.
std::optional<std::array<std::int32_t, 2>> find_crossing(const TriangleSurface& surface);

/// Closed manifold at distance `offset_m` around a triangle soup that enters no gap narrower than `alpha_m`.
TriangleSurface wrap(const TriangleSurface& surface, double alpha_m, double offset_m);

}  // namespace carillon::mesher

// Mid-side nodes on the true surface.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Finds the skin position for the midpoint `middle` of a boundary edge with outward unit normal `normal`, within reach_m; empty if none.
using SkinPlace = std::function<std::optional<Vec3>(const Vec3& middle, const Vec3& normal, double reach_m)>;

struct CurvedEdges {
  std::int64_t curved = 0;        // boundary edges whose mid node left the middle
  std::int64_t left = 0;          // boundary edges left straight: no skin near enough
  std::int64_t straightened = 0;  // folded elements made straight-sided again
};

/// Moves the mid nodes of boundary edges of a straight-sided quadratic mesh onto the skin, those of sharp edges onto `curves`; elements
/// that fold become straight again. Inner mid nodes stay at the midpoints.
CurvedEdges curve_mesh(mesh::TetMesh& mesh, const std::vector<Polyline>& curves, const SkinPlace& find_place);

}  // namespace carillon::mesher

// Mid-side nodes on the true surface.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Finds the place on the body's skin for the middle of a boundary edge: near `middle`, where the mesh has the outward unit normal
/// `normal`, not farther than reach_m; nothing if there is none.
using SkinPlace = std::function<std::optional<Vec3>(const Vec3& middle, const Vec3& normal, double reach_m)>;

struct CurvedEdges {
  std::int64_t curved = 0;        // boundary edges whose mid node left the middle
  std::int64_t left = 0;          // boundary edges that stayed straight since no skin was found near enough
  std::int64_t straightened = 0;  // elements that would have folded and went back to straight sides
};

/// Moves the mid nodes of boundary edges of a quadratic mesh with straight sides onto the skin, those of sharp edges onto `curves`, then
/// makes the elements straight again that this folds. Mid nodes inside stay in the middle.
CurvedEdges curve_mesh(mesh::TetMesh& mesh, const std::vector<Polyline>& curves, const SkinPlace& find_place);

}  // namespace carillon::mesher

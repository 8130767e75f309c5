// Shapes of colliders: KHR_implicit_shapes, and meshes. Internal header.
#pragma once

#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/exchange/gltf/file.hpp"
#include "runtime/exchange/gltf/nodes.hpp"
#include "runtime/exchange/silent.hpp"

namespace carillon::exchange {

inline constexpr const char* kShapesExtension = "KHR_implicit_shapes";
inline constexpr double kFarthestGltfM = 1e4;  // of scene files

/// A number of `low` to `high`; `fallback` if missing. Throws InputError.
double read_positive(base::Object& owner, const char* key, double fallback, double low, double high);

/// The shape of a "geometry" of a collider, in the space of its node. `shapes`: of KHR_implicit_shapes. Throws InputError.
Surface read_geometry(gltf::File& file, gltf::Graph& graph, std::vector<base::Object>& shapes, base::Object& geometry);

}  // namespace carillon::exchange

// Node transforms of glTF files.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::gltf {

using Matrix = std::array<double, 16>;  // column-major
inline constexpr Matrix kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Matrix multiply(const Matrix& a, const Matrix& b);
Vec3 move(const Matrix& m, const Vec3& p);
/// Determinant of the upper left 3x3 block; negative for a reflection.
double calc_determinant(const Matrix& m);

/// Scale of a transform that turns and scales alike along all axes; nullopt for any other one.
std::optional<double> find_scale(const Matrix& m);

/// Nodes of a file. Invariant: parents form trees.
struct Graph {
  std::vector<base::Object> nodes;
  std::vector<std::optional<std::size_t>> parent;
  std::vector<std::vector<std::size_t>> children;
  std::vector<Matrix> global;         // node to world
  std::vector<std::size_t> in_scene;  // of the file's scene, parents first; all nodes without a scene
};

/// Throws InputError for children and scenes that do not exist, nodes with two parents, nodes that are their own ancestors, and transforms
/// that are not finite.
Graph read_graph(base::Object& root);

/// Local transform of a node: "matrix", or "translation", "rotation" and "scale". Throws InputError for an invalid rotation.
Matrix read_transform(base::Object& node);

}  // namespace carillon::gltf

// Transforms of the nodes of a glTF file.
#pragma once

#include <array>

#include "runtime/base/document.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::gltf {

using Matrix = std::array<double, 16>;  // column by column
inline constexpr Matrix kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Matrix multiply(const Matrix& a, const Matrix& b);
Vec3 move(const Matrix& m, const Vec3& p);
/// Determinant of the first three rows and columns: negative for a reflection.
double calc_determinant(const Matrix& m);

/// A node's own "matrix", or its "translation", "rotation" and "scale". Throws InputError for an invalid rotation.
Matrix read_transform(base::Object& node);

}  // namespace carillon::gltf

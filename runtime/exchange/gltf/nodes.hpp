// Node transforms of glTF files.
#pragma once

#include <array>

#include "runtime/base/document.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::gltf {

using Matrix = std::array<double, 16>;  // column-major
inline constexpr Matrix kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Matrix multiply(const Matrix& a, const Matrix& b);
Vec3 move(const Matrix& m, const Vec3& p);
/// Determinant of the upper left 3x3 block; negative for a reflection.
double calc_determinant(const Matrix& m);

/// Local transform of a node: "matrix", or "translation", "rotation" and "scale". Throws InputError for an invalid rotation.
Matrix read_transform(base::Object& node);

}  // namespace carillon::gltf

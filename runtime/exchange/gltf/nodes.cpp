// Method: column-vector matrices T R S.
// Source: glTF 2.0 specification, chapter 3.5.3.
// Deviations: rotations are normalised to unit quaternions.
#include "runtime/exchange/gltf/nodes.hpp"

#include <cmath>

namespace carillon::gltf {

Matrix multiply(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 4; ++k) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  return c;
}

Vec3 move(const Matrix& m, const Vec3& p) {
  Vec3 q{m[12], m[13], m[14]};
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) q[i] += m[4 * k + i] * p[k];
  return q;
}

double calc_determinant(const Matrix& m) { return dot(Vec3{m[0], m[1], m[2]}, cross(Vec3{m[4], m[5], m[6]}, Vec3{m[8], m[9], m[10]})); }

Matrix read_transform(base::Object& node) {
  if (node.has("matrix")) return node.numbers<16>("matrix");
  const auto t = node.numbers_or<3>("translation", {0, 0, 0}), s = node.numbers_or<3>("scale", {1, 1, 1});
  auto q = node.numbers_or<4>("rotation", {0, 0, 0, 1});
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(length > 0)) node.fail("rotation", "is not a rotation; it must be a unit quaternion");
  for (double& x : q) x /= length;
  const auto [x, y, z, w] = q;
  return {s[0] * (1 - 2 * (y * y + z * z)),
          s[0] * 2 * (x * y + z * w),
          s[0] * 2 * (x * z - y * w),
          0,
          s[1] * 2 * (x * y - z * w),
          s[1] * (1 - 2 * (x * x + z * z)),
          s[1] * 2 * (y * z + x * w),
          0,
          s[2] * 2 * (x * z + y * w),
          s[2] * 2 * (y * z - x * w),
          s[2] * (1 - 2 * (x * x + y * y)),
          0,
          t[0],
          t[1],
          t[2],
          1};
}

}  // namespace carillon::gltf

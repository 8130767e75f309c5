// 3-vectors and 3x3 matrices.
#pragma once

#include <array>
#include <cmath>

namespace carillon {

using Vec3 = std::array<double, 3>;
using Mat3 = std::array<Vec3, 3>;  // rows

inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vec3 operator*(double s, const Vec3& a) { return {s * a[0], s * a[1], s * a[2]}; }
inline double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double norm(const Vec3& a) { return std::sqrt(dot(a, a)); }
/// As norm(), without overflow of the squares.
inline double calc_length(const Vec3& a) { return std::hypot(a[0], a[1], a[2]); }
inline Vec3 normalise(const Vec3& a) { return (1.0 / norm(a)) * a; }
/// As normalise(); zero for a zero vector.
inline Vec3 calc_unit(const Vec3& a) {
  const double length = norm(a);
  return length > 0 ? (1 / length) * a : Vec3{};
}
/// Determinant of the matrix with rows a, b, c.
inline double calc_det(const Vec3& a, const Vec3& b, const Vec3& c) { return dot(a, cross(b, c)); }
/// Unit vector of the axis with the smallest component of n; the first of several.
inline Vec3 find_least_axis(const Vec3& n) {
  std::size_t k = 0;
  for (std::size_t i = 1; i < 3; ++i)
    if (std::abs(n[i]) < std::abs(n[k])) k = i;
  Vec3 axis{};
  axis[k] = 1.0;
  return axis;
}
/// Unit vector perpendicular to n.
inline Vec3 find_across(const Vec3& n) {
  const Vec3 axis = std::abs(n[0]) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  return normalise(cross(n, axis));
}

/// Two unit vectors perpendicular to n and to each other.
inline std::array<Vec3, 2> find_tangents(const Vec3& n) {
  Vec3 first = cross(n, find_least_axis(n));
  const double length = norm(first);
  for (double& x : first) x /= length;
  return {first, cross(n, first)};
}

inline bool is_finite(const Vec3& a) { return std::isfinite(a[0]) && std::isfinite(a[1]) && std::isfinite(a[2]); }
/// From its rows, one after another.
inline Mat3 make_matrix(const std::array<double, 9>& m) { return {Vec3{m[0], m[1], m[2]}, Vec3{m[3], m[4], m[5]}, Vec3{m[6], m[7], m[8]}}; }
inline Vec3 operator*(const Mat3& m, const Vec3& a) { return {dot(m[0], a), dot(m[1], a), dot(m[2], a)}; }
/// M^T a.
inline Vec3 turn_back(const Mat3& m, const Vec3& a) { return a[0] * m[0] + a[1] * m[1] + a[2] * m[2]; }
inline Mat3 transpose(const Mat3& m) {
  return {Vec3{m[0][0], m[1][0], m[2][0]}, Vec3{m[0][1], m[1][1], m[2][1]}, Vec3{m[0][2], m[1][2], m[2][2]}};
}
inline Mat3 operator*(const Mat3& a, const Mat3& b) {
  const Mat3 t = transpose(b);
  return {t * a[0], t * a[1], t * a[2]};
}
/// Inverse of a non-singular symmetric matrix.
inline Mat3 calc_inverse(const Mat3& m) {
  const Vec3 a = cross(m[1], m[2]), b = cross(m[2], m[0]), c = cross(m[0], m[1]);
  const double s = 1.0 / dot(m[0], a);
  return {Vec3{s * a[0], s * b[0], s * c[0]}, Vec3{s * a[1], s * b[1], s * c[1]}, Vec3{s * a[2], s * b[2], s * c[2]}};
}

}  // namespace carillon

// Points, weights and shape functions on the reference tetrahedron, in barycentric coordinates.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::fem {

inline constexpr int kMaxNodes = 10;

using Barycentric = std::array<double, 4>;

struct Point {
  Barycentric at{};
  double weight = 0.0;  // weights sum to 1; multiply by the element's volume
};

/// Degree 5, fourteen points (Walkington 2000): stiffness of curved T10.
const std::vector<Point>& get_rule_of_degree_5();

/// Degree 7, 125 points: Gauss-Legendre in the cube collapsed to the tetrahedron (Stroud's conical product). For precomputed tables.
const std::vector<Point>& get_rule_of_degree_7();

/// The 20 points whose barycentric coordinates are thirds, corners included: they determine a cubic.
const std::array<Barycentric, 20>& get_thirds();

/// Values at `at` of the 20 Lagrange cubics of the thirds.
std::array<double, 20> calc_cubics(const Barycentric& at);

/// Shape functions of the T10 and their derivatives by (L1, L2, L3), L0 = 1 - L1 - L2 - L3.
struct Shape {
  std::array<double, kMaxNodes> value{};
  std::array<Vec3, kMaxNodes> derivative{};
};

Shape calc_shape(const Barycentric& at);
std::vector<Shape> calc_shapes(const std::vector<Point>& rule);

/// Isoparametric map of a T10 at one point.
struct Jacobian {
  double determinant = 0.0;       // of d x / d xi: six times the volume for a linear map
  std::array<Vec3, 3> inverse{};  // inverse[d][k] = d xi_d / d x_k
};

double calc_determinant(std::span<const Vec3> x, const Shape& shape);
Jacobian calc_jacobian(std::span<const Vec3> x, const Shape& shape);

}  // namespace carillon::fem

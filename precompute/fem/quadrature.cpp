// Source: Walkington 2000, "Quadrature on simplices of arbitrary dimension" (degree 5); Stroud 1971, "Approximate calculation of multiple
//   integrals" (conical product).
#include "precompute/fem/quadrature.hpp"

#include <cmath>

#include "runtime/base/vector.hpp"

namespace carillon::fem {

const std::vector<Point>& get_rule_of_degree_5() {
  static const std::vector<Point> rule = [] {
    std::vector<Point> points;
    const auto add_vertex_orbit = [&](double b, double weight) {
      for (int i = 0; i < 4; ++i) {
        Point point{{b, b, b, b}, weight};
        point.at[i] = 1.0 - 3.0 * b;
        points.push_back(point);
      }
    };
    add_vertex_orbit(0.31088591926330060980, 0.11268792571801585080);
    add_vertex_orbit(0.09273525031089122640, 0.07349304311636194954);
    const double c = 0.04550370412564964949;
    for (const auto& edge : mesh::kEdges) {
      Point point{{c, c, c, c}, 0.04254602077708146644};
      point.at[edge[0]] = point.at[edge[1]] = 0.5 - c;
      points.push_back(point);
    }
    return points;
  }();
  return rule;
}

const std::vector<Point>& get_rule_of_degree_7() {
  static const std::vector<Point> rule = [] {
    const double inner = std::sqrt(5.0 - 2.0 * std::sqrt(10.0 / 7.0)) / 3.0, outer = std::sqrt(5.0 + 2.0 * std::sqrt(10.0 / 7.0)) / 3.0;
    const double w_inner = (322.0 + 13.0 * std::sqrt(70.0)) / 1800.0, w_outer = (322.0 - 13.0 * std::sqrt(70.0)) / 1800.0;
    const std::array<std::array<double, 2>, 5> gauss{{{(1 - outer) / 2, w_outer},
                                                      {(1 - inner) / 2, w_inner},
                                                      {0.5, 64.0 / 225.0},
                                                      {(1 + inner) / 2, w_inner},
                                                      {(1 + outer) / 2, w_outer}}};
    std::vector<Point> points;
    for (const auto& [u, wu] : gauss)
      for (const auto& [v, wv] : gauss)
        for (const auto& [w, ww] : gauss) {
          const double l1 = u, l2 = (1 - u) * v, l3 = (1 - u) * (1 - v) * w;
          points.push_back({{1 - l1 - l2 - l3, l1, l2, l3}, 6.0 * wu * wv * ww * (1 - u) * (1 - u) * (1 - v)});
        }
    return points;
  }();
  return rule;
}

const std::array<Barycentric, 20>& get_thirds() {
  static const std::array<Barycentric, 20> points = [] {
    std::array<Barycentric, 20> list{};
    int n = 0;
    for (int a = 3; a >= 0; --a)
      for (int b = 3 - a; b >= 0; --b)
        for (int c = 3 - a - b; c >= 0; --c) list[n++] = {a / 3.0, b / 3.0, c / 3.0, (3 - a - b - c) / 3.0};
    return list;
  }();
  return points;
}

std::array<double, 20> calc_cubics(const Barycentric& at) {
  std::array<double, 20> values{};
  for (int k = 0; k < 20; ++k) {
    values[k] = 1.0;
    for (int m = 0; m < 4; ++m) {
      const int thirds = static_cast<int>(std::lround(3 * get_thirds()[k][m]));
      for (int s = 0; s < thirds; ++s) values[k] *= (3 * at[m] - s) / (s + 1);
    }
  }
  return values;
}

Shape calc_shape(const Barycentric& l) {
  constexpr std::array<Vec3, 4> kGradient{{{-1, -1, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  Shape shape;
  for (int i = 0; i < 4; ++i) {
    shape.value[i] = l[i] * (2 * l[i] - 1);
    for (int d = 0; d < 3; ++d) shape.derivative[i][d] = (4 * l[i] - 1) * kGradient[i][d];
  }
  for (int e = 0; e < 6; ++e) {
    const auto [a, b] = mesh::kEdges[e];
    shape.value[4 + e] = 4 * l[a] * l[b];
    for (int d = 0; d < 3; ++d) shape.derivative[4 + e][d] = 4 * (l[a] * kGradient[b][d] + l[b] * kGradient[a][d]);
  }
  return shape;
}

std::vector<Shape> calc_shapes(const std::vector<Point>& rule) {
  std::vector<Shape> shapes;
  for (const Point& point : rule) shapes.push_back(calc_shape(point.at));
  return shapes;
}

namespace {

/// j[d][k] = d x_k / d xi_d
std::array<Vec3, 3> calc_tangents(std::span<const Vec3> x, const Shape& shape) {
  std::array<Vec3, 3> j{};
  for (int i = 0; i < kMaxNodes; ++i)
    for (int d = 0; d < 3; ++d)
      for (int k = 0; k < 3; ++k) j[d][k] += shape.derivative[i][d] * x[i][k];
  return j;
}

}  // namespace

double calc_determinant(std::span<const Vec3> x, const Shape& shape) {
  const auto j = calc_tangents(x, shape);
  return dot(j[0], cross(j[1], j[2]));
}

Jacobian calc_jacobian(std::span<const Vec3> x, const Shape& shape) {
  const auto j = calc_tangents(x, shape);
  const std::array<Vec3, 3> rows{cross(j[1], j[2]), cross(j[2], j[0]), cross(j[0], j[1])};
  Jacobian jacobian;
  jacobian.determinant = dot(j[0], rows[0]);
  for (int d = 0; d < 3; ++d)
    for (int k = 0; k < 3; ++k) jacobian.inverse[d][k] = rows[d][k] / jacobian.determinant;
  return jacobian;
}

}  // namespace carillon::fem

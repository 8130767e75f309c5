// Method: Galerkin finite elements of isotropic linear elasticity on tetrahedra. Stiffness block of nodes i and j from their gradients b:
//   k_ij = integral ( lambda b_i b_j^T + mu b_j b_i^T + mu (b_i . b_j) I ) dV,    m_ij = integral rho N_i N_j dV I.
// Source: OSG02 eqs. 12, 14, 15 (T4); Zienkiewicz and Taylor, The Finite Element Method, vol. 1 (T10); Hinton, Rock and Zienkiewicz 1976,
//   Earthquake Eng. Struct. Dyn. 4, 245 (HRZ lumping); Walkington 2000, "Quadrature on simplices of arbitrary dimension" (degree 5).
// Deviations: OSG02 eq. 12 is printed with -vol/2; stiffness is minus the Jacobian of the force, which gives +vol. OSG02's row-sum lumping
//   (eq. 15) is negative at the corners of a T10, so T10 is lumped by HRZ: the diagonal of the consistent mass scaled to the true mass.
#include "precompute/fem/element.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace carillon::fem {
namespace {

using Barycentric = std::array<double, 4>;

struct Point {
  Barycentric at{};
  double weight = 0.0;  // the weights of a rule sum to 1, the volume of the element being a factor apart
};

/// Degree 2, four points: exact for the stiffness of straight-sided T10.
const std::vector<Point>& rule_of_degree_2() {
  static const std::vector<Point> rule = [] {
    const double a = (5.0 + 3.0 * std::sqrt(5.0)) / 20.0;
    const double b = (5.0 - std::sqrt(5.0)) / 20.0;
    std::vector<Point> points;
    for (int i = 0; i < 4; ++i) {
      Point point{{b, b, b, b}, 0.25};
      point.at[i] = a;
      points.push_back(point);
    }
    return points;
  }();
  return rule;
}

/// Degree 5, fourteen points (Walkington 2000): stiffness of curved T10.
const std::vector<Point>& rule_of_degree_5() {
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

/// Degree 7, 125 points: Gauss-Legendre in the cube collapsed to the tetrahedron (Stroud's conical product). Mass of curved T10.
const std::vector<Point>& rule_of_degree_7() {
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

/// Shape functions of the T10 and their derivatives with respect to (L1, L2, L3), L0 = 1 - L1 - L2 - L3.
struct Shape {
  std::array<double, kMaxNodes> value{};
  std::array<Vec3, kMaxNodes> derivative{};
};

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

struct Jacobian {
  double determinant = 0.0;
  std::array<Vec3, 3> inverse{};  // inverse[d][k] = d xi_d / d x_k
};

Jacobian calc_jacobian(std::span<const Vec3> x, const Shape& shape) {
  std::array<Vec3, 3> j{};  // j[d][k] = d x_k / d xi_d
  for (int i = 0; i < kMaxNodes; ++i)
    for (int d = 0; d < 3; ++d)
      for (int k = 0; k < 3; ++k) j[d][k] += shape.derivative[i][d] * x[i][k];
  const auto cross = [](const Vec3& a, const Vec3& b) {
    return Vec3{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  Jacobian jacobian;
  const std::array<Vec3, 3> rows{cross(j[1], j[2]), cross(j[2], j[0]), cross(j[0], j[1])};
  jacobian.determinant = j[0][0] * rows[0][0] + j[0][1] * rows[0][1] + j[0][2] * rows[0][2];
  for (int d = 0; d < 3; ++d)
    for (int k = 0; k < 3; ++k) jacobian.inverse[d][k] = rows[d][k] / jacobian.determinant;
  return jacobian;
}

/// Adds volume * k_ij for all pairs of nodes of gradients b, upper triangle of blocks only.
void add_stiffness(std::span<const Vec3> b, double lambda, double mu, double volume, ElementMatrices& out) {
  const int n = out.nodes;
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) {
      const double dot = b[i][0] * b[j][0] + b[i][1] * b[j][1] + b[i][2] * b[j][2];
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
          out.stiffness[(3 * i + r) * 3 * n + 3 * j + c] +=
              volume * (lambda * b[i][r] * b[j][c] + mu * b[j][r] * b[i][c] + (r == c ? mu * dot : 0.0));
    }
}

void mirror_stiffness(ElementMatrices& out) {
  const int width = 3 * out.nodes;
  for (int row = 0; row < width; ++row)
    for (int column = row + 1; column < width; ++column) out.stiffness[column * width + row] = out.stiffness[row * width + column];
}

/// Gradients of the barycentric coordinates and the volume of a straight tetrahedron.
double calc_linear(std::span<const Vec3> x, std::array<Vec3, 4>& b) {
  std::array<Vec3, 3> e;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) e[i][k] = x[i + 1][k] - x[0][k];
  const auto cross = [](const Vec3& p, const Vec3& q) {
    return Vec3{p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
  };
  const std::array<Vec3, 3> area{cross(e[1], e[2]), cross(e[2], e[0]), cross(e[0], e[1])};
  const double determinant = e[0][0] * area[0][0] + e[0][1] * area[0][1] + e[0][2] * area[0][2];
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i) b[i + 1][k] = area[i][k] / determinant;
    b[0][k] = -(b[1][k] + b[2][k] + b[3][k]);
  }
  return determinant / 6.0;
}

/// True when every mid-side node lies in the middle of its edge, to 1e-9 of the edge's length.
bool is_straight(std::span<const Vec3> x) {
  for (int e = 0; e < 6; ++e) {
    const Vec3 &a = x[mesh::kEdges[e][0]], &b = x[mesh::kEdges[e][1]];
    double off = 0.0, length = 0.0;
    for (int k = 0; k < 3; ++k) {
      off += std::pow(x[4 + e][k] - (a[k] + b[k]) / 2, 2);
      length += std::pow(b[k] - a[k], 2);
    }
    if (off > 1e-18 * length) return false;
  }
  return true;
}

/// m_ij / (rho V) of the straight T10, in 420ths, from integral L0^a L1^b L2^c L3^d dV = 6 V a! b! c! d! / (a + b + c + d + 3)!.
double straight_mass_420(int i, int j) {
  if (i > j) std::swap(i, j);
  if (j < 4) return i == j ? 6 : 1;
  const auto& edge = mesh::kEdges[j - 4];
  if (i < 4) return i == edge[0] || i == edge[1] ? -4 : -6;
  if (i == j) return 32;
  const auto& other = mesh::kEdges[i - 4];
  const bool touch = edge[0] == other[0] || edge[0] == other[1] || edge[1] == other[0] || edge[1] == other[1];
  return touch ? 16 : 8;
}

void lump_hrz(ElementMatrices& out, double mass_kg) {
  const int n = out.nodes;
  double trace = 0.0;
  for (int i = 0; i < n; ++i) trace += out.mass[i * n + i];
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) out.mass[i * n + j] = i == j ? out.mass[i * n + i] * mass_kg / trace : 0.0;
}

bool calc_curved(std::span<const Vec3> x, const spec::Material& material, ElementMatrices& out, double& mass_kg) {
  static const std::vector<Shape> kStiffness = calc_shapes(rule_of_degree_5()), kMass = calc_shapes(rule_of_degree_7());
  static const std::vector<Shape> kNodes = [] {
    std::vector<Shape> shapes;
    for (int i = 0; i < kMaxNodes; ++i) {
      Barycentric l{};
      if (i < 4) {
        l[i] = 1.0;
      } else {
        l[mesh::kEdges[i - 4][0]] = l[mesh::kEdges[i - 4][1]] = 0.5;
      }
      shapes.push_back(calc_shape(l));
    }
    return shapes;
  }();
  for (const Shape& shape : kNodes)
    if (!(calc_jacobian(x, shape).determinant > 0.0)) return false;
  for (std::size_t q = 0; q < kStiffness.size(); ++q) {
    const Jacobian jacobian = calc_jacobian(x, kStiffness[q]);
    if (!(jacobian.determinant > 0.0)) return false;
    std::array<Vec3, kMaxNodes> b{};
    for (int i = 0; i < kMaxNodes; ++i)
      for (int d = 0; d < 3; ++d)
        for (int k = 0; k < 3; ++k) b[i][k] += kStiffness[q].derivative[i][d] * jacobian.inverse[d][k];
    add_stiffness(b, material.lame_lambda_pa(), material.lame_mu_pa(), rule_of_degree_5()[q].weight * jacobian.determinant / 6.0, out);
  }
  mass_kg = 0.0;
  for (std::size_t q = 0; q < kMass.size(); ++q) {
    const double determinant = calc_jacobian(x, kMass[q]).determinant;
    if (!(determinant > 0.0)) return false;
    const double rho_dv = material.density_kg_m3 * rule_of_degree_7()[q].weight * determinant / 6.0;
    mass_kg += rho_dv;
    const auto& value = kMass[q].value;
    for (int i = 0; i < kMaxNodes; ++i)
      for (int j = 0; j < kMaxNodes; ++j) out.mass[i * kMaxNodes + j] += rho_dv * value[i] * value[j];
  }
  return true;
}

void calc_straight_t10(std::span<const Vec3> b_corner, double volume, const spec::Material& material, ElementMatrices& out) {
  static const std::vector<Shape> kShapes = calc_shapes(rule_of_degree_2());
  for (std::size_t q = 0; q < kShapes.size(); ++q) {
    std::array<Vec3, kMaxNodes> b{};
    for (int i = 0; i < kMaxNodes; ++i)
      for (int d = 0; d < 3; ++d)
        for (int k = 0; k < 3; ++k) b[i][k] += kShapes[q].derivative[i][d] * b_corner[d + 1][k];
    add_stiffness(b, material.lame_lambda_pa(), material.lame_mu_pa(), rule_of_degree_2()[q].weight * volume, out);
  }
  for (int i = 0; i < kMaxNodes; ++i)
    for (int j = 0; j < kMaxNodes; ++j) out.mass[i * kMaxNodes + j] = material.density_kg_m3 * volume * straight_mass_420(i, j) / 420.0;
}

}  // namespace

bool calc_element(std::span<const Vec3> x, const spec::Material& material, spec::Mass mass, ElementMatrices& out) {
  const int n = static_cast<int>(x.size());
  out.nodes = n;
  std::fill_n(out.stiffness.begin(), 9 * n * n, 0.0);
  std::fill_n(out.mass.begin(), n * n, 0.0);
  std::array<Vec3, 4> b;
  const double volume = calc_linear(x.first(4), b);
  double mass_kg = material.density_kg_m3 * volume;
  if (n == kMaxNodes && !is_straight(x)) {
    if (!calc_curved(x, material, out, mass_kg)) return false;
  } else {
    if (!(volume > 0.0)) return false;
    if (n == kMaxNodes) {
      calc_straight_t10(b, volume, material, out);
    } else {
      add_stiffness(b, material.lame_lambda_pa(), material.lame_mu_pa(), volume, out);
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) out.mass[i * 4 + j] = mass_kg / 20.0 * (i == j ? 2 : 1);
    }
  }
  mirror_stiffness(out);
  if (mass == spec::Mass::lumped) lump_hrz(out, mass_kg);  // for the T4, whose diagonal is constant, this is the row sum
  return true;
}

ElementMoments calc_moments(std::span<const Vec3> x, double density_kg_m3) {
  ElementMoments moments;
  const auto add = [&](const Vec3& at, double dv) {
    moments.volume_m3 += dv;
    moments.mass_kg += density_kg_m3 * dv;
    for (int r = 0; r < 3; ++r) {
      moments.first_kg_m[r] += density_kg_m3 * dv * at[r];
      for (int c = 0; c < 3; ++c) moments.second_kg_m2[3 * r + c] += density_kg_m3 * dv * at[r] * at[c];
    }
  };
  if (x.size() == kMaxNodes && !is_straight(x)) {
    static const std::vector<Shape> kShapes = calc_shapes(rule_of_degree_7());
    for (std::size_t q = 0; q < kShapes.size(); ++q) {
      Vec3 at{};
      for (int i = 0; i < kMaxNodes; ++i)
        for (int k = 0; k < 3; ++k) at[k] += kShapes[q].value[i] * x[i][k];
      add(at, rule_of_degree_7()[q].weight * calc_jacobian(x, kShapes[q]).determinant / 6.0);
    }
    return moments;
  }
  std::array<Vec3, 4> b;
  const double volume = calc_linear(x.first(4), b);
  for (const Point& point : rule_of_degree_2()) {
    Vec3 at{};
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k) at[k] += point.at[i] * x[i][k];
    add(at, point.weight * volume);
  }
  return moments;
}

}  // namespace carillon::fem

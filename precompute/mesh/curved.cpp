// Method: the Jacobian of the quadratic map is a cubic in barycentric coordinates. Its Bernstein coefficients follow from products of the
//   linear slopes; if all are positive, so is the Jacobian. Otherwise it is evaluated at the nodes and quadrature points only (the paper
//   subdivides until the sign is proven).
// Source: Johnen, Remacle and Geuzaine 2013, "Geometrical validity of curvilinear finite elements", J. Comput. Phys. 233, 359 (bounds by
//   Bernstein coefficients); Keast 1986, CMAME 55, 339, the 11-point rule of degree 4; Walkington 2000, the 14-point rule of degree 5;
//   Stroud's conical product of 125 points; Zienkiewicz and Taylor, the 4-point rule of degree 2.
#include "precompute/mesh/curved.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/vector.hpp"

namespace carillon::mesh {

namespace {

using Barycentric = std::array<double, 4>;

/// slope[k][j]: dx / dxi_(k+1) = sum_j L_j slope[k][j]. From N_i = L_i (2 L_i - 1), 4 L_i L_j and sum L = 1.
using Slopes = std::array<std::array<Vec3, 4>, 3>;

Slopes calc_slopes(const TetMesh& mesh, std::int64_t e) {
  const auto tet = mesh.tet(e);
  std::array<std::array<Vec3, 4>, 4> g{};  // dx / dL_i = sum_j L_j g[i][j]
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec3& x = mesh.nodes_m[tet[i]];
    for (std::size_t j = 0; j < 4; ++j)
      for (std::size_t k = 0; k < 3; ++k) g[i][j][k] = (i == j ? 3.0 : -1.0) * x[k];
  }
  for (std::size_t m = 0; m < 6; ++m) {
    const std::size_t i = kEdges[m][0], j = kEdges[m][1];
    const Vec3& x = mesh.nodes_m[tet[4 + m]];
    for (std::size_t k = 0; k < 3; ++k) {
      g[i][j][k] += 4.0 * x[k];
      g[j][i][k] += 4.0 * x[k];
    }
  }
  Slopes slopes{};
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < 4; ++j) slopes[k][j] = g[k + 1][j] - g[0][j];
  return slopes;
}

double calc_determinant(const Slopes& slopes, const Barycentric& L) {
  std::array<Vec3, 3> d{};
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < 4; ++j)
      for (std::size_t c = 0; c < 3; ++c) d[k][c] += L[j] * slopes[k][j][c];
  return dot(d[0], cross(d[1], d[2]));
}

/// True if all twenty Bernstein coefficients are positive.
bool is_positive_throughout(const Slopes& slopes) {
  std::array<std::array<std::array<double, 4>, 4>, 4> sum{};  // over permutations of (j, k, l), stored at the ascending one
  for (std::size_t j = 0; j < 4; ++j)
    for (std::size_t k = 0; k < 4; ++k)
      for (std::size_t l = 0; l < 4; ++l) {
        std::array<std::size_t, 3> at{j, k, l};
        std::sort(at.begin(), at.end());
        sum[at[0]][at[1]][at[2]] += dot(slopes[0][j], cross(slopes[1][k], slopes[2][l]));
      }
  for (std::size_t j = 0; j < 4; ++j)
    for (std::size_t k = j; k < 4; ++k)
      for (std::size_t l = k; l < 4; ++l)
        if (!(sum[j][k][l] > 0.0)) return false;
  return true;
}

struct Point {
  Barycentric at;
  double weight;  // relative to the reference volume 1/6; set for the 11-point rule only
};

void add_orbit(std::vector<Point>& points, double other, double weight) {
  for (std::size_t k = 0; k < 4; ++k) {
    Barycentric b{other, other, other, other};
    b[k] = 1.0 - 3.0 * other;
    points.push_back({b, weight});
  }
}

void add_edge_orbit(std::vector<Point>& points, double other, double weight) {
  for (const auto& edge : kEdges) {
    Barycentric b{other, other, other, other};
    b[edge[0]] = b[edge[1]] = 0.5 - other;
    points.push_back({b, weight});
  }
}

const std::vector<Point>& get_points() {
  static const std::vector<Point> points = [] {
    std::vector<Point> list;
    add_orbit(list, 0.0, 0.0);  // corners and mid nodes
    add_edge_orbit(list, 0.0, 0.0);
    add_orbit(list, (5.0 - std::sqrt(5.0)) / 20.0, 0.0);
    list.push_back({{0.25, 0.25, 0.25, 0.25}, -74.0 / 5625.0});
    add_orbit(list, 1.0 / 14.0, 343.0 / 45000.0);
    add_edge_orbit(list, (1.0 - std::sqrt(5.0 / 14.0)) / 4.0, 28.0 / 1125.0);
    add_orbit(list, 0.31088591926330060980, 0.0);
    add_orbit(list, 0.09273525031089122640, 0.0);
    add_edge_orbit(list, 0.04550370412564964949, 0.0);
    const double inner = std::sqrt(5.0 - 2.0 * std::sqrt(10.0 / 7.0)) / 3.0, outer = std::sqrt(5.0 + 2.0 * std::sqrt(10.0 / 7.0)) / 3.0;
    for (const double a : {-outer, -inner, 0.0, inner, outer})
      for (const double b : {-outer, -inner, 0.0, inner, outer})
        for (const double c : {-outer, -inner, 0.0, inner, outer}) {
          const double u = (1 + a) / 2, v = (1 - u) * (1 + b) / 2, w = (1 - u - v) * (1 + c) / 2;
          list.push_back({{1 - u - v - w, u, v, w}, 0.0});
        }
    return list;
  }();
  return points;
}

}  // namespace

Vec3 calc_middle(const TetMesh& mesh, std::int64_t e, std::size_t edge) {
  const Vec3& a = mesh.nodes_m[mesh.tet(e)[kEdges[edge][0]]];
  const Vec3& b = mesh.nodes_m[mesh.tet(e)[kEdges[edge][1]]];
  return {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])};
}

bool is_curved(const TetMesh& mesh, std::int64_t e) {
  constexpr double kMaxMidNodeOffsetRatio = 1e-6;  // relative to the edge length
  for (std::size_t m = 0; m < 6; ++m) {
    const auto tet = mesh.tet(e);
    const Vec3 off = mesh.nodes_m[tet[4 + m]] - calc_middle(mesh, e, m);
    const Vec3 edge = mesh.nodes_m[tet[kEdges[m][1]]] - mesh.nodes_m[tet[kEdges[m][0]]];
    if (dot(off, off) > kMaxMidNodeOffsetRatio * kMaxMidNodeOffsetRatio * dot(edge, edge)) return true;
  }
  return false;
}

double calc_jacobian(const TetMesh& mesh, std::int64_t e, const Barycentric& L) { return calc_determinant(calc_slopes(mesh, e), L); }

bool is_folded(const TetMesh& mesh, std::int64_t e) {
  const Slopes slopes = calc_slopes(mesh, e);
  if (is_positive_throughout(slopes)) return false;
  const auto& points = get_points();
  return std::any_of(points.begin(), points.end(), [&](const Point& point) { return !(calc_determinant(slopes, point.at) > 0.0); });
}

double calc_curved_volume(const TetMesh& mesh, std::int64_t e) {
  const Slopes slopes = calc_slopes(mesh, e);
  double volume = 0.0;
  for (const Point& point : get_points())
    if (point.weight != 0.0) volume += point.weight * calc_determinant(slopes, point.at);
  return volume;
}

namespace {

void straighten_element(TetMesh& mesh, std::int64_t e) {
  for (std::size_t m = 0; m < 6; ++m) mesh.nodes_m[mesh.tet(e)[4 + m]] = calc_middle(mesh, e, m);
}

}  // namespace

void straighten(TetMesh& mesh) {
  for (std::int64_t e = 0; mesh.order == 2 && e < mesh.tet_count(); ++e) straighten_element(mesh, e);
}

std::int64_t straighten_folded_elements(TetMesh& mesh) {
  if (mesh.order == 1) return 0;
  std::vector<std::int64_t> curved;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    if (is_curved(mesh, e)) curved.push_back(e);
  // Straightening moves mid nodes shared with neighbours, so iterate until no element is folded. Terminates: each pass straightens at least
  // one element for good, and straight elements of positive volume are not folded.
  std::int64_t straightened = 0;
  for (bool again = true; again;) {
    again = false;
    for (const auto e : curved) {
      if (!is_curved(mesh, e) || !is_folded(mesh, e)) continue;
      straighten_element(mesh, e);
      ++straightened;
      again = true;
    }
  }
  return straightened;
}

}  // namespace carillon::mesh

// Method: dihedral angles from the outward area vectors of the faces; mean ratio; Jacobian of the quadratic map at quadrature points.
// Source: Liu and Joe 1994, "Relationship between tetrahedron shape measures", BIT 34, eq. (mean ratio eta); Keast 1986, "Moderate-degree
//   tetrahedral quadrature formulas", the 11-point rule of degree 4; Zienkiewicz and Taylor, the 4-point rule of degree 2.
// Deviations: none.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/mesh/check_parts.hpp"

namespace carillon::mesh {

namespace {

Vec3 minus(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vec3 cross(const Vec3& a, const Vec3& b) { return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}; }

struct QuadraturePoint {
  std::array<double, 4> barycentric;
  double weight;  // of the reference volume 1/6
};

/// Four points of degree 2, then the eleven of degree 4; only the latter carry weight here.
const std::vector<QuadraturePoint>& quadrature_points() {
  static const std::vector<QuadraturePoint> points = [] {
    std::vector<QuadraturePoint> list;
    const auto add_corner_like = [&](double other, double weight) {
      for (std::size_t k = 0; k < 4; ++k) {
        std::array<double, 4> b{other, other, other, other};
        b[k] = 1.0 - 3.0 * other;
        list.push_back({b, weight});
      }
    };
    add_corner_like((5.0 - std::sqrt(5.0)) / 20.0, 0.0);
    list.push_back({{0.25, 0.25, 0.25, 0.25}, -74.0 / 5625.0});
    add_corner_like(1.0 / 14.0, 343.0 / 45000.0);
    const double near = (1.0 + std::sqrt(5.0 / 14.0)) / 4.0;
    const double far = (1.0 - std::sqrt(5.0 / 14.0)) / 4.0;
    for (const auto& edge : kEdges) {
      std::array<double, 4> b{far, far, far, far};
      b[static_cast<std::size_t>(edge[0])] = b[static_cast<std::size_t>(edge[1])] = near;
      list.push_back({b, 28.0 / 1125.0});
    }
    return list;
  }();
  return points;
}

/// det(dx / dxi) of the quadratic map at barycentric coordinates L.
/// Shape functions L_i (2 L_i - 1) and 4 L_i L_j; the derivative along xi_k is d/dL_k - d/dL_0.
double calc_jacobian(const TetMesh& mesh, std::int64_t e, const std::array<double, 4>& L) {
  const auto tet = mesh.tet(e);
  std::array<Vec3, 4> slope{};  // dx / dL_i
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k) slope[i][k] = (4.0 * L[i] - 1.0) * mesh.nodes[static_cast<std::size_t>(tet[i])][k];
  for (std::size_t m = 0; m < 6; ++m) {
    const auto i = static_cast<std::size_t>(kEdges[m][0]), j = static_cast<std::size_t>(kEdges[m][1]);
    const Vec3& x = mesh.nodes[static_cast<std::size_t>(tet[4 + m])];
    for (std::size_t k = 0; k < 3; ++k) {
      slope[i][k] += 4.0 * L[j] * x[k];
      slope[j][k] += 4.0 * L[i] * x[k];
    }
  }
  return dot(minus(slope[1], slope[0]), cross(minus(slope[2], slope[0]), minus(slope[3], slope[0])));
}

Vec3 middle_of(const TetMesh& mesh, std::int64_t e, std::size_t edge) {
  const Vec3& a = mesh.nodes[static_cast<std::size_t>(mesh.tet(e)[static_cast<std::size_t>(kEdges[edge][0])])];
  const Vec3& b = mesh.nodes[static_cast<std::size_t>(mesh.tet(e)[static_cast<std::size_t>(kEdges[edge][1])])];
  return {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])};
}

bool is_curved(const TetMesh& mesh, std::int64_t e) {
  constexpr double kStraight = 1e-6;  // of the edge's length
  for (std::size_t m = 0; m < 6; ++m) {
    const auto tet = mesh.tet(e);
    const Vec3 off = minus(mesh.nodes[static_cast<std::size_t>(tet[4 + m])], middle_of(mesh, e, m));
    const Vec3 edge = minus(mesh.nodes[static_cast<std::size_t>(tet[static_cast<std::size_t>(kEdges[m][1])])],
                            mesh.nodes[static_cast<std::size_t>(tet[static_cast<std::size_t>(kEdges[m][0])])]);
    if (dot(off, off) > kStraight * kStraight * dot(edge, edge)) return true;
  }
  return false;
}

}  // namespace

void straighten_folded(TetMesh& mesh, CheckReport& report) {
  if (mesh.order == 1) return;
  std::vector<std::int64_t> curved;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    if (is_curved(mesh, e)) curved.push_back(e);
  const auto folded = [&](std::int64_t e) {
    const auto& points = quadrature_points();
    return std::any_of(points.begin(), points.end(),
                       [&](const QuadraturePoint& point) { return calc_jacobian(mesh, e, point.barycentric) <= 0.0; });
  };
  // Straightening one element moves mid nodes of its neighbours, so it repeats until none is folded. It ends: each pass straightens at
  // least one element for good, and straight elements of positive volume are not folded.
  for (bool again = true; again;) {
    again = false;
    for (const auto e : curved) {
      if (!is_curved(mesh, e) || !folded(e)) continue;
      for (std::size_t m = 0; m < 6; ++m) mesh.nodes[static_cast<std::size_t>(mesh.tet(e)[4 + m])] = middle_of(mesh, e, m);
      ++report.straightened;
      again = true;
    }
  }
  for (const auto e : curved) report.curved += is_curved(mesh, e);
}

void calc_quality(const TetMesh& mesh, CheckReport& report) {
  constexpr double kSliverDeg = 5.0;
  const double sliver_cosine = std::cos(kSliverDeg * std::numbers::pi / 180.0);
  report.box_low = report.box_high = mesh.nodes.front();
  for (const Vec3& x : mesh.nodes)
    for (std::size_t k = 0; k < 3; ++k) {
      report.box_low[k] = std::min(report.box_low[k], x[k]);
      report.box_high[k] = std::max(report.box_high[k], x[k]);
    }
  const std::int64_t count = mesh.tet_count();
  std::vector<double> ratios(static_cast<std::size_t>(count));
  double greatest = -1.0, least = 1.0, sum = 0.0;  // of the cosines of the dihedral angles
  for (std::int64_t e = 0; e < count; ++e) {
    const auto tet = mesh.tet(e);
    std::array<Vec3, 4> x{};
    for (std::size_t i = 0; i < 4; ++i) x[i] = mesh.nodes[static_cast<std::size_t>(tet[i])];
    std::array<Vec3, 4> normal{};
    for (std::size_t f = 0; f < 4; ++f) {
      const auto [i, j, k] = kFaces[f];
      const Vec3& origin = x[static_cast<std::size_t>(i)];
      normal[f] = cross(minus(x[static_cast<std::size_t>(j)], origin), minus(x[static_cast<std::size_t>(k)], origin));
      const double length = std::sqrt(dot(normal[f], normal[f]));
      for (double& value : normal[f]) value /= length;
    }
    double own_greatest = -1.0, own_least = 1.0;
    for (const auto& [f, g] : kEdges) {  // every pair of faces, too
      const double cosine = -dot(normal[static_cast<std::size_t>(f)], normal[static_cast<std::size_t>(g)]);
      own_greatest = std::max(own_greatest, cosine);
      own_least = std::min(own_least, cosine);
    }
    greatest = std::max(greatest, own_greatest);
    least = std::min(least, own_least);
    report.slivers += own_greatest > sliver_cosine || own_least < -sliver_cosine;
    const double volume = dot(minus(x[1], x[0]), cross(minus(x[2], x[0]), minus(x[3], x[0]))) / 6.0;
    double squares = 0.0;
    for (const auto& [i, j] : kEdges) {
      const Vec3 edge = minus(x[static_cast<std::size_t>(j)], x[static_cast<std::size_t>(i)]);
      squares += dot(edge, edge);
    }
    const double root = std::cbrt(3.0 * volume);
    ratios[static_cast<std::size_t>(e)] = 12.0 * root * root / squares;
    sum += ratios[static_cast<std::size_t>(e)];
    if (mesh.order == 1 || report.curved == 0 || !is_curved(mesh, e)) {
      report.volume_m3 += volume;
    } else {
      for (const auto& point : quadrature_points())
        if (point.weight != 0.0) report.volume_m3 += point.weight * calc_jacobian(mesh, e, point.barycentric);
    }
  }
  const double degrees = 180.0 / std::numbers::pi;
  report.min_dihedral_deg = degrees * std::acos(std::clamp(greatest, -1.0, 1.0));
  report.max_dihedral_deg = degrees * std::acos(std::clamp(least, -1.0, 1.0));
  report.mean_ratio_mean = sum / static_cast<double>(count);
  report.mean_ratio_min = *std::min_element(ratios.begin(), ratios.end());
  const auto percentile = ratios.begin() + count / 100;
  std::nth_element(ratios.begin(), percentile, ratios.end());
  report.mean_ratio_1_percent = *percentile;
}

}  // namespace carillon::mesh

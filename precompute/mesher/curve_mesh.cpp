// Method: the mid node of a boundary edge moves along the mean normal of its two boundary faces to the skin; on a sharp curve it moves to
//   the nearest curve point. Folded elements become straight-sided again: few elements fold, so no reshaping or swapping is needed.
// Source: Dey, O'Bara and Shephard 2001, "Towards curvilinear meshing in 3D: the case of quadratic simplices", CAD 33, 199, section 3.
#include "precompute/mesher/curve_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "precompute/mesh/curved.hpp"
#include "precompute/mesher/tet_quality.hpp"

namespace carillon::mesher {
namespace {

// A mid node displaced by more than this part of its edge belongs to another part of the skin, or would fold the element.
constexpr double kReach = 0.3;
// Faces with a larger turn at an edge may lie on two sides of a sharp curve (cosine of 15 degrees).
constexpr double kTurn = 0.966;
// An end lies on a curve if nearer than this part of the edge.
constexpr double kMaxCurveDistancePerEdge = 1e-3;

struct BoundaryEdge {
  std::int32_t a = 0, b = 0;  // ends, a < b
  std::int32_t middle = 0;
  std::array<Vec3, 2> normals{};  // unit, of its two faces
};

/// Boundary edges, ordered by their ends.
std::vector<BoundaryEdge> find_boundary_edges(const mesh::TetMesh& mesh) {
  mesh::TetMesh linear;  // corners only, same numbering
  linear.nodes_m = mesh.nodes_m;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) linear.tets.insert(linear.tets.end(), mesh.tet(e).begin(), mesh.tet(e).begin() + 4);
  std::map<std::array<std::int32_t, 2>, BoundaryEdge> edges;
  for (const Triangle& t : find_boundary(linear)) {
    const Vec3 area = cross(mesh.nodes_m[t[1]] - mesh.nodes_m[t[0]], mesh.nodes_m[t[2]] - mesh.nodes_m[t[0]]);
    const Vec3 normal = (1 / norm(area)) * area;
    for (int c = 0; c < 3; ++c) {
      const auto [a, b] = std::minmax(t[c], t[(c + 1) % 3]);
      BoundaryEdge& edge = edges[{a, b}];
      edge.normals[norm(edge.normals[0]) > 0 ? 1 : 0] = normal;
    }
  }
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (std::size_t m = 0; m < 6; ++m) {
      const auto tet = mesh.tet(e);
      const auto [a, b] = std::minmax(tet[mesh::kEdges[m][0]], tet[mesh::kEdges[m][1]]);
      const auto found = edges.find({a, b});
      if (found != edges.end()) found->second.a = a, found->second.b = b, found->second.middle = tet[4 + m];
    }
  std::vector<BoundaryEdge> out;
  for (const auto& [ends, edge] : edges) out.push_back(edge);
  return out;
}

/// Point of the curves nearest to p, and its distance.
std::pair<Vec3, double> find_on_curves(const std::vector<Polyline>& curves, const Vec3& p) {
  std::pair<Vec3, double> best{{}, HUGE_VAL};
  for (const Polyline& curve : curves)
    for (std::size_t i = 1; i < curve.size(); ++i) {
      const Vec3 &a = curve[i - 1], along = curve[i] - a;
      const double square = dot(along, along);
      const double t = square > 0 ? std::clamp(dot(p - a, along) / square, 0.0, 1.0) : 0;
      const Vec3 q = a + t * along;
      if (const double distance = norm(p - q); distance < best.second) best = {q, distance};
    }
  return best;
}

}  // namespace

CurvedEdges curve_mesh(mesh::TetMesh& mesh, const std::vector<Polyline>& curves, const SkinPlace& find_place) {
  CurvedEdges out;
  for (const BoundaryEdge& edge : find_boundary_edges(mesh)) {
    const Vec3 &a = mesh.nodes_m[edge.a], &b = mesh.nodes_m[edge.b];
    const double length = norm(b - a), reach = kReach * length;
    const Vec3 middle = 0.5 * (a + b), sum = edge.normals[0] + edge.normals[1];
    std::optional<Vec3> place;
    if (!curves.empty() && dot(edge.normals[0], edge.normals[1]) < kTurn &&
        find_on_curves(curves, a).second < kMaxCurveDistancePerEdge * length &&
        find_on_curves(curves, b).second < kMaxCurveDistancePerEdge * length) {
      const auto [on_curve, distance] = find_on_curves(curves, middle);
      if (distance < reach) place = on_curve;
    }
    if (!place && norm(sum) > 0.2) place = find_place(middle, (1 / norm(sum)) * sum, reach);
    if (!place) {
      ++out.left;
    } else if (norm(*place - middle) > 1e-6 * length) {
      mesh.nodes_m[edge.middle] = *place;
      ++out.curved;
    }
  }
  out.straightened = mesh::straighten_folded_elements(mesh);
  return out;
}

}  // namespace carillon::mesher

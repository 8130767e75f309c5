// Method: at a point of a sharp edge with adjacent unit normals n_i, the offset planes meet at the point displaced by x, the minimum-norm
//   least-squares solution of n_i . x = -wall; kept if it is `wall` from the surface.
// Source: Pavic and Kobbelt, "High-resolution volumetric computation of offset surfaces with feature preservation", CGF 27(2), 2008,
//   section 4 (the same point as minimum of a quadric); here only along known sharp edges.
#include "precompute/mesher/inset_curves.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>

namespace carillon::mesher {
namespace {

// Faces with a smaller normal difference are one side of the edge (cosine of 25 degrees).
constexpr double kMinSideCosine = 0.906;
// Relative tolerance of the wall distance for points of the inner skin.
constexpr double kTolerance = 0.02;

using Normals = std::vector<Vec3>;

Vec3 calc_area_normal(const TriangleSurface& surface, const Triangle& t) {
  return cross(surface.points[t[1]] - surface.points[t[0]], surface.points[t[2]] - surface.points[t[0]]);
}

/// One unit normal per side.
Normals group_sides(const Normals& area_normals) {
  Normals sums;
  for (const Vec3& n : area_normals) {
    if (!(norm(n) > 0)) continue;
    const auto same = std::find_if(sums.begin(), sums.end(), [&](const Vec3& s) { return dot(s, n) > kMinSideCosine * norm(s) * norm(n); });
    if (same == sums.end())
      sums.push_back(n);
    else
      *same = *same + n;
  }
  for (Vec3& s : sums) s = (1 / norm(s)) * s;
  return sums;
}

Vec3 calc_inset(const Normals& sides, double wall_m) {
  if (sides.empty()) return {};
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();  // normal equations
  Eigen::Vector3d right = Eigen::Vector3d::Zero(), x = right;
  for (const Vec3& side : sides) {
    const Eigen::Vector3d n(side[0], side[1], side[2]);
    normal += n * n.transpose();
    right -= wall_m * n;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(normal);
  for (int i = 0; i < 3; ++i) {
    const double square = solver.eigenvalues()[i];
    const auto direction = solver.eigenvectors().col(i);
    // Tolerance for the facets of a rounded side.
    if (square >= 0.01 * solver.eigenvalues()[2]) x += direction * (direction.dot(right) / square);
  }
  return {x[0], x[1], x[2]};
}

}  // namespace

std::vector<Polyline> make_inset_curves(const TriangleSurface& surface, const std::vector<Polyline>& curves, const NearestPoint& nearest,
                                        double wall_m, double spacing_m) {
  std::map<Vec3, Normals> at_point;
  std::map<std::array<Vec3, 2>, Normals> at_edge;
  for (const Polyline& curve : curves)
    for (std::size_t i = 0; i < curve.size(); ++i) {
      at_point[curve[i]];
      if (i > 0) at_edge[curve[i - 1] < curve[i] ? std::array{curve[i - 1], curve[i]} : std::array{curve[i], curve[i - 1]}];
    }
  for (const Triangle& t : surface.triangles)
    for (int c = 0; c < 3; ++c) {
      const Vec3 &a = surface.points[t[c]], &b = surface.points[t[(c + 1) % 3]];
      const Vec3 normal = calc_area_normal(surface, t);
      if (const auto found = at_point.find(a); found != at_point.end()) found->second.push_back(normal);
      if (const auto found = at_edge.find(a < b ? std::array{a, b} : std::array{b, a}); found != at_edge.end())
        found->second.push_back(normal);
    }

  const auto is_on_skin = [&](const Vec3& p) { return std::abs(norm(nearest.find(p) - p) - wall_m) < kTolerance * wall_m; };
  std::vector<Polyline> out;
  for (const Polyline& curve : curves) {
    Polyline piece;
    const auto finish = [&] {
      if (piece.size() > 1) out.push_back(piece);
      piece.clear();
    };
    // A corner is the same point in all its curves; it replaces points too close before it.
    const auto add = [&](const Vec3& p, const Normals& normals, bool corner) {
      const Vec3 q = p + calc_inset(group_sides(normals), wall_m);
      if (!is_on_skin(q)) return;
      if (!piece.empty() && norm(q - piece.back()) > 3 * spacing_m) finish();
      if (corner)
        while (piece.size() > 1 && norm(q - piece.back()) < 0.4 * spacing_m) piece.pop_back();
      if (piece.empty() || norm(q - piece.back()) > 0.4 * spacing_m) piece.push_back(q);
    };
    add(curve.front(), at_point.at(curve.front()), true);
    for (std::size_t i = 0; i + 1 < curve.size(); ++i) {
      const Vec3 &a = curve[i], &b = curve[i + 1];
      const Normals& sides = at_edge.at(a < b ? std::array{a, b} : std::array{b, a});
      const int pieces = static_cast<int>(std::ceil(norm(b - a) / spacing_m));
      for (int k = 1; k < pieces; ++k) add(a + (static_cast<double>(k) / pieces) * (b - a), sides, false);
      add(b, at_point.at(b), i + 2 == curve.size());
    }
    // A closed curve with a complete inset is closed as well.
    if (curve.front() == curve.back() && piece.size() > 2 && norm(piece.front() - piece.back()) < 3 * spacing_m)
      piece.back() = piece.front();
    finish();
  }
  // Merge ends that nearly meet: the mesher would put ever smaller balls between them.
  std::vector<Vec3*> ends;
  for (Polyline& piece : out)
    for (Vec3* end : {&piece.front(), &piece.back()}) {
      const auto close = std::find_if(ends.begin(), ends.end(), [&](const Vec3* other) { return norm(*other - *end) < 0.5 * spacing_m; });
      if (close != ends.end()) *end = **close;
      ends.push_back(end);
    }
  std::erase_if(out, [](const Polyline& piece) { return piece.size() == 2 && piece.front() == piece.back(); });
  return out;
}

}  // namespace carillon::mesher

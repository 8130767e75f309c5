// Method: dihedral angles from the outward area vectors of the faces; mean ratio; volume.
// Source: Liu and Joe 1994, "Relationship between tetrahedron shape measures", BIT 34 (mean ratio eta).
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "precompute/mesh/check_parts.hpp"
#include "precompute/mesh/curved.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesh {

namespace {}  // namespace

void straighten_folded(TetMesh& mesh, CheckReport& report) {
  report.straightened = straighten_folded_elements(mesh);
  for (std::int64_t e = 0; mesh.order == 2 && e < mesh.tet_count(); ++e) report.curved += is_curved(mesh, e);
}

void calc_quality(const TetMesh& mesh, CheckReport& report) {
  constexpr double kSliverDeg = 5.0;
  const double sliver_cosine = std::cos(kSliverDeg * std::numbers::pi / 180.0);
  report.box_low = report.box_high = mesh.nodes_m.front();
  for (const Vec3& x : mesh.nodes_m)
    for (std::size_t k = 0; k < 3; ++k) {
      report.box_low[k] = std::min(report.box_low[k], x[k]);
      report.box_high[k] = std::max(report.box_high[k], x[k]);
    }
  const std::int64_t count = mesh.tet_count();
  std::vector<double> ratios(count);
  double shortest = std::numeric_limits<double>::infinity();  // squared edge
  double max = -1.0, min = 1.0, sum = 0.0;                    // cosines of the dihedral angles
  for (std::int64_t e = 0; e < count; ++e) {
    const auto tet = mesh.tet(e);
    std::array<Vec3, 4> x{};
    for (std::size_t i = 0; i < 4; ++i) x[i] = mesh.nodes_m[tet[i]];
    std::array<Vec3, 4> normal{};
    for (std::size_t f = 0; f < 4; ++f) {
      const auto [i, j, k] = kFaces[f];
      const Vec3& origin = x[i];
      normal[f] = cross(x[j] - origin, x[k] - origin);
      const double length = std::sqrt(dot(normal[f], normal[f]));
      for (double& value : normal[f]) value /= length;
    }
    double own_max = -1.0, own_min = 1.0;
    for (const auto& [f, g] : kEdges) {  // also every pair of faces
      const double cosine = -dot(normal[f], normal[g]);
      own_max = std::max(own_max, cosine);
      own_min = std::min(own_min, cosine);
    }
    max = std::max(max, own_max);
    min = std::min(min, own_min);
    report.slivers += own_max > sliver_cosine || own_min < -sliver_cosine;
    const double volume = dot(x[1] - x[0], cross(x[2] - x[0], x[3] - x[0])) / 6.0;
    double squares = 0.0;
    for (const auto& [i, j] : kEdges) {
      const Vec3 edge = x[j] - x[i];
      squares += dot(edge, edge);
      shortest = std::min(shortest, dot(edge, edge));
    }
    const double root = std::cbrt(3.0 * volume);
    ratios[e] = 12.0 * root * root / squares;
    sum += ratios[e];
    if (mesh.order == 1 || report.curved == 0 || !is_curved(mesh, e)) {
      report.volume_m3 += volume;
    } else {
      report.volume_m3 += calc_curved_volume(mesh, e);
    }
  }
  report.shortest_edge_m = std::sqrt(shortest);
  const double degrees = 180.0 / std::numbers::pi;
  report.min_dihedral_deg = degrees * std::acos(std::clamp(max, -1.0, 1.0));
  report.max_dihedral_deg = degrees * std::acos(std::clamp(min, -1.0, 1.0));
  report.mean_ratio_mean = sum / static_cast<double>(count);
  report.mean_ratio_min = *std::min_element(ratios.begin(), ratios.end());
  const auto percentile = ratios.begin() + count / 100;
  std::nth_element(ratios.begin(), percentile, ratios.end());
  report.mean_ratio_1_percent = *percentile;
}

}  // namespace carillon::mesh

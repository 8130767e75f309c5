// Method: a skin node is displaced by the vector from its nearest point on the triangles to the corresponding smooth-surface point. The
//   inner skin of a shell moves with the outer one. Displacements are of the order of a triangle's sagitta. Shell skins come from a sampled
//   distance, linear between samples and off a curved skin by up to an eighth of the squared spacing over the radius; there the target
//   distance is zero or the wall.
#include "precompute/mesher/place_nodes.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "precompute/mesh/curved.hpp"
#include "precompute/mesher/tet_quality.hpp"

namespace carillon::mesher {
namespace {

// Least remaining part of an element's volume.
constexpr double kMinRemainingVolumeRatio = 0.3;
// Relative to the sample spacing: larger offsets from the skin are not interpolation errors.
constexpr double kMaxOff = 0.25;

double calc_volume(const mesh::TetMesh& mesh, std::int64_t e) {
  const auto tet = mesh.tet(e);
  const Vec3& origin = mesh.nodes_m[tet[0]];
  return dot(cross(mesh.nodes_m[tet[1]] - origin, mesh.nodes_m[tet[2]] - origin), mesh.nodes_m[tet[3]] - origin) / 6;
}

}  // namespace

std::int64_t place_on_smooth_surface(mesh::TetMesh& mesh, const Body& body, bool straight) {
  if (!body.round) return 0;
  mesh::TetMesh linear;  // corners only, same numbering
  linear.nodes_m = mesh.nodes_m;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) linear.tets.insert(linear.tets.end(), mesh.tet(e).begin(), mesh.tet(e).begin() + 4);
  std::vector<char> on_skin(mesh.nodes_m.size(), 0);
  std::set<Edge> edges;  // of the skin
  for (const Triangle& t : find_boundary(linear))
    for (int c = 0; c < 3; ++c) {
      on_skin[t[c]] = 1;
      edges.insert(make_edge(t[c], t[(c + 1) % 3]));
    }
  std::vector<Vec3> way(mesh.nodes_m.size(), Vec3{});
  // Part of the displacement from the surface by which a node is off its skin.
  const auto calc_off = [&](const Vec3& inward) {
    const double depth = norm(inward);
    if (!body.field || body.wall_m <= 0 || depth == 0) return 0.0;
    const double off = depth < body.wall_m / 2 ? depth : depth - body.wall_m;
    return std::abs(off) < kMaxOff * body.field->voxel_m ? off / depth : 0.0;
  };
  const auto find_way = [&](std::int32_t v) {
    const auto [at, triangle] = body.nearest->find_on(mesh.nodes_m[v]);
    const Vec3 inward = mesh.nodes_m[v] - at;
    way[v] = body.round->find(triangle, at) - at - calc_off(inward) * inward;
    if (!mesh.doubt_m.empty()) mesh.doubt_m[v] = body.round->find_doubt(triangle, at);
  };
  if (body.round->is_doubtful()) mesh.doubt_m.assign(mesh.nodes_m.size(), Vec3{});
  for (std::size_t v = 0; v < on_skin.size(); ++v)
    if (on_skin[v] != 0) find_way(static_cast<std::int32_t>(v));
  // Corners first.
  std::vector<double> volumes;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) volumes.push_back(calc_volume(linear, e));
  for (bool again = true; again;) {
    again = false;
    for (std::size_t v = 0; v < mesh.nodes_m.size(); ++v) linear.nodes_m[v] = mesh.nodes_m[v] + way[v];
    for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
      if (calc_volume(linear, e) > kMinRemainingVolumeRatio * volumes[e]) continue;
      for (int c = 0; c < 4; ++c) {
        const std::int32_t v = linear.tets[4 * e + c];
        again = again || norm(way[v]) > 0;
        way[v] = {};
      }
    }
  }
  if (mesh.order == 1) {
    mesh.nodes_m = linear.nodes_m;
    return 0;
  }
  std::vector<char> done(mesh.nodes_m.size(), 0);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (int m = 0; m < 6; ++m) {
      const std::int32_t a = mesh.tet(e)[mesh::kEdges[m][0]], b = mesh.tet(e)[mesh::kEdges[m][1]], middle = mesh.tet(e)[4 + m];
      if (done[middle] != 0) continue;
      done[middle] = 1;
      if (!straight && edges.contains(make_edge(a, b)))
        find_way(middle);
      else
        way[middle] = 0.5 * (way[a] + way[b]);
    }
  for (std::size_t v = 0; v < mesh.nodes_m.size(); ++v) mesh.nodes_m[v] = mesh.nodes_m[v] + way[v];
  return straight ? 0 : mesh::straighten_folded_elements(mesh);
}

void remark_doubt(const mesh::TetMesh& mesh, SurfaceReport& report) {
  for (const Vec3& way : mesh.doubt_m) report.doubt_m = std::max(report.doubt_m, norm(way));
  if (report.doubt_m > 0)
    report.remarks.push_back(fmt::format(
        "Some facets are so coarse that they may be planes of the body or samples of a smooth surface, up to {:.3g} m apart. What that "
        "changes is stated next to the error bars. A surface in finer facets settles it, or --facets if they are planes.",
        report.doubt_m));
}

}  // namespace carillon::mesher

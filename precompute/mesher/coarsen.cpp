// Method: CGAL's edge collapse: cost is the edge length, placement after Lindstrom and Turk where it stays near the edge. Their cost
//   function leaves few triangles on flat faces, but waves need them everywhere.
// Source: P. Lindstrom, G. Turk, Fast and memory efficient polygonal simplification, IEEE Visualization 1998.
#include "precompute/mesher/coarsen.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Edge_length_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>

#include "runtime/base/error.hpp"

namespace carillon::mesher {
namespace {

namespace PMP = CGAL::Polygon_mesh_processing;
namespace SMS = CGAL::Surface_mesh_simplification;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

/// Stops at three edges per corner (up to the genus).
class StopAtEdges {
 public:
  explicit StopAtEdges(std::size_t edges) : edges_(edges) {}
  template <typename Cost, typename Profile>
  bool operator()(const Cost&, const Profile&, std::size_t, std::size_t current) const {
    return current <= edges_;
  }

 private:
  std::size_t edges_;
};

/// Placement of Lindstrom and Turk, limited to near the edge: at rims of thin bodies it would move outward to preserve their volume.
class NearPlacement {
 public:
  template <typename Profile>
  auto operator()(const Profile& profile) const {
    auto placed = placement_(profile);
    if (!placed) return placed;
    const Kernel::Segment_3 edge(profile.p0(), profile.p1());
    if (CGAL::squared_distance(*placed, edge) > kMaxDistancePerEdge * kMaxDistancePerEdge * edge.squared_length()) placed.reset();
    return placed;
  }

 private:
  static constexpr double kMaxDistancePerEdge = 0.1;  // edges
  SMS::LindstromTurk_placement<Mesh> placement_;
};

}  // namespace

TriangleSurface coarsen(const TriangleSurface& surface, std::size_t corners) {
  if (corners < 12) throw InputError("--coarsen: give 12 corners or more");
  std::vector<Kernel::Point_3> points;
  for (const Vec3& p : surface.points) points.emplace_back(p[0], p[1], p[2]);
  std::vector<std::vector<std::size_t>> polygons;
  for (const Triangle& t : surface.triangles)
    polygons.push_back({static_cast<std::size_t>(t[0]), static_cast<std::size_t>(t[1]), static_cast<std::size_t>(t[2])});
  if (!PMP::is_polygon_soup_a_polygon_mesh(polygons)) throw InputError("--coarsen: an edge of the surface does not have two triangles");
  Mesh mesh;
  PMP::polygon_soup_to_polygon_mesh(points, polygons, mesh);
  if (!CGAL::is_closed(mesh)) throw InputError("--coarsen: the surface is open");
  if (mesh.number_of_vertices() > corners)
    SMS::edge_collapse(mesh, StopAtEdges(3 * corners),
                       CGAL::parameters::get_cost(SMS::Edge_length_cost<Mesh>()).get_placement(NearPlacement()));
  mesh.collect_garbage();
  TriangleSurface coarse;
  for (const auto vertex : mesh.vertices()) {
    const auto& p = mesh.point(vertex);
    coarse.points.push_back({p.x(), p.y(), p.z()});
  }
  for (const auto face : mesh.faces()) {
    Triangle triangle{};
    std::size_t corner = 0;
    for (const auto vertex : CGAL::vertices_around_face(mesh.halfedge(face), mesh))
      triangle[corner++] = static_cast<std::int32_t>(static_cast<std::size_t>(vertex));
    coarse.triangles.push_back(triangle);
  }
  return coarse;
}

}  // namespace carillon::mesher

// Method: least-area hole filling and alpha wrapping, both from CGAL 5.5.
// Source: Liepa, "Filling holes in meshes", SGP 2003; Portaneri et al., "Alpha wrapping with an offset", ACM TOG 41(4), 2022.
#include "precompute/mesher/repair.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Polygon_mesh_processing/shape_predicates.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>

#include <algorithm>

namespace carillon::mesher {
namespace {

namespace PMP = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Mesh = CGAL::Surface_mesh<Point>;

std::vector<Point> make_points(const std::vector<Vec3>& points) {
  std::vector<Point> out;
  out.reserve(points.size());
  for (const Vec3& p : points) out.emplace_back(p[0], p[1], p[2]);
  return out;
}

std::vector<std::vector<std::size_t>> make_polygons(const std::vector<Triangle>& triangles) {
  std::vector<std::vector<std::size_t>> out;
  out.reserve(triangles.size());
  for (const Triangle& t : triangles)
    out.push_back({static_cast<std::size_t>(t[0]), static_cast<std::size_t>(t[1]), static_cast<std::size_t>(t[2])});
  return out;
}

}  // namespace

std::vector<Triangle> fill_polygon(const Polyline& polygon) {
  if (polygon.size() < 3) return {};
  if (polygon.size() == 3) return {{0, 1, 2}};
  // Cubic time in the corners where the Delaunay triangulation has no filling.
  constexpr std::size_t kMaxCorners = 1500;
  if (polygon.size() > kMaxCorners) return {};
  struct Face {
    int a, b, c;
    Face(int i, int j, int k) : a(i), b(j), c(k) {}
  };
  std::vector<Face> faces;
  try {
    PMP::triangulate_hole_polyline(make_points(polygon), std::back_inserter(faces));
  } catch (const std::exception&) {
    return {};  // CGAL's preconditions on degenerate polygons; the caller has a fallback
  }
  std::vector<Triangle> out;
  for (const Face& f : faces) out.push_back({f.a, f.b, f.c});
  return out;
}

bool is_clean(const TriangleSurface& surface) {
  const auto polygons = make_polygons(surface.triangles);
  if (!PMP::is_polygon_soup_a_polygon_mesh(polygons)) return false;
  Mesh mesh;
  PMP::polygon_soup_to_polygon_mesh(make_points(surface.points), polygons, mesh);
  for (const auto face : faces(mesh))
    if (PMP::is_degenerate_triangle_face(face, mesh)) return false;
  // Own nesting test: CGAL's crashes on surfaces of very different lengths.
  return CGAL::is_closed(mesh) && !PMP::does_self_intersect(mesh) && is_nested(surface);
}

std::optional<std::array<std::int32_t, 2>> find_crossing(const TriangleSurface& surface) {
  const auto polygons = make_polygons(surface.triangles);
  if (!PMP::is_polygon_soup_a_polygon_mesh(polygons)) return std::array{0, 0};
  Mesh mesh;
  PMP::polygon_soup_to_polygon_mesh(make_points(surface.points), polygons, mesh);
  std::vector<std::pair<Mesh::Face_index, Mesh::Face_index>> crossing;
  PMP::self_intersections<CGAL::Sequential_tag>(mesh, std::back_inserter(crossing));
  if (crossing.empty()) return std::nullopt;
  const auto first = std::min_element(crossing.begin(), crossing.end());
  return std::array{static_cast<std::int32_t>(first->first), static_cast<std::int32_t>(first->second)};
}

TriangleSurface wrap(const TriangleSurface& surface, double alpha_m, double offset_m) {
  Mesh mesh;
  CGAL::alpha_wrap_3(make_points(surface.points), make_polygons(surface.triangles), alpha_m, offset_m, mesh);
  TriangleSurface out;
  for (const auto v : mesh.vertices()) out.points.push_back({mesh.point(v).x(), mesh.point(v).y(), mesh.point(v).z()});
  for (const auto f : mesh.faces()) {
    Triangle t{};
    int c = 0;
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) t[c++] = static_cast<std::int32_t>(v.idx());
    out.triangles.push_back(t);
  }
  return out;
}

}  // namespace carillon::mesher

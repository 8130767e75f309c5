// Delaunay body inside a clean triangle surface. Method and source: delaunay.cpp.
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polyhedral_mesh_domain_3.h>
#include <CGAL/Surface_mesh.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "precompute/mesher/body_queries.hpp"

namespace carillon::mesher {
namespace {

using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Domain = CGAL::Polyhedral_mesh_domain_3<Mesh, Kernel>;

class SurfaceQueries final : public DomainQueries<Domain> {
 public:
  explicit SurfaceQueries(const TriangleSurface& surface) : surface_(surface) {
    std::vector<Kernel::Point_3> points;
    for (const Vec3& p : surface.points) points.emplace_back(p[0], p[1], p[2]);
    std::vector<std::vector<std::size_t>> polygons;
    for (const Triangle& t : surface.triangles)
      polygons.push_back({static_cast<std::size_t>(t[0]), static_cast<std::size_t>(t[1]), static_cast<std::size_t>(t[2])});
    CGAL::Polygon_mesh_processing::polygon_soup_to_polygon_mesh(points, polygons, mesh_);
  }

  void restart(std::size_t) override { domain_ = std::make_unique<Domain>(mesh_); }

  std::vector<Vec3> find_first_points(double spacing_m) override {
    // Interior points of the triangles: on an edge the patch of a Delaunay edge's crossing would be ambiguous.
    std::vector<Vec3> points;
    // One per cube of the spacing and face direction, so that both sides of a thin plate are sampled.
    std::set<std::array<std::int64_t, 4>> taken;
    for (const Triangle& t : surface_.triangles) {
      const Vec3 &a = surface_.points[t[0]], &b = surface_.points[t[1]], &c = surface_.points[t[2]];
      const Vec3 normal = cross(b - a, c - a);
      int axis = 0;
      for (int k = 1; k < 3; ++k)
        if (std::abs(normal[k]) > std::abs(normal[axis])) axis = k;
      const double longest = std::max({norm(b - a), norm(c - b), norm(a - c)});
      const int pieces = std::clamp(static_cast<int>(std::ceil(longest / spacing_m)), 1, 200);
      for (int i = 0; i < pieces; ++i)
        for (int j = 0; i + j < pieces; ++j) {
          const double u = (i + 0.34) / pieces, v = (j + 0.29) / pieces;
          const Vec3 p = (1 - u - v) * a + (u * b + v * c);
          std::array<std::int64_t, 4> cube{0, 0, 0, normal[axis] > 0 ? axis : 3 + axis};
          for (int k = 0; k < 3; ++k) cube[k] = static_cast<std::int64_t>(std::floor(p[k] / spacing_m));
          if (taken.insert(cube).second) points.push_back(p);
        }
    }
    return points;
  }

 private:
  const TriangleSurface& surface_;
  Mesh mesh_;
};

}  // namespace

std::unique_ptr<DelaunayBody> make_surface_body(const TriangleSurface& surface, const std::vector<Polyline>& curves) {
  return make_delaunay_body(std::make_unique<SurfaceQueries>(surface), curves);
}

}  // namespace carillon::mesher

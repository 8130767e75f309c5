#include "precompute/mesher/nearest.hpp"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

namespace carillon::mesher {

using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;

struct NearestPoint::Tree {
  Triangles triangles;
  CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>>> tree;
};

NearestPoint::NearestPoint(const TriangleSurface& surface) : tree_(std::make_unique<Tree>()) {
  const auto point = [&](std::int32_t v) {
    const Vec3& p = surface.points[static_cast<std::size_t>(v)];
    return Kernel::Point_3(p[0], p[1], p[2]);
  };
  for (const Triangle& t : surface.triangles) {
    const Kernel::Triangle_3 triangle(point(t[0]), point(t[1]), point(t[2]));
    if (!triangle.is_degenerate()) tree_->triangles.push_back(triangle);  // its edges belong to its neighbours too
  }
  tree_->tree.insert(tree_->triangles.cbegin(), tree_->triangles.cend());
  tree_->tree.accelerate_distance_queries();
}

NearestPoint::~NearestPoint() = default;

Vec3 NearestPoint::find(const Vec3& p) const {
  const auto q = tree_->tree.closest_point({p[0], p[1], p[2]});
  return {q.x(), q.y(), q.z()};
}

}  // namespace carillon::mesher

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
  std::vector<std::int32_t> number;  // of each among those of the surface
  CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>>> tree;
};

NearestPoint::NearestPoint(const TriangleSurface& surface) : tree_(std::make_unique<Tree>()) {
  const auto point = [&](std::int32_t v) {
    const Vec3& p = surface.points[static_cast<std::size_t>(v)];
    return Kernel::Point_3(p[0], p[1], p[2]);
  };
  for (std::size_t f = 0; f < surface.triangles.size(); ++f) {
    const Triangle& t = surface.triangles[f];
    const Kernel::Triangle_3 triangle(point(t[0]), point(t[1]), point(t[2]));
    if (triangle.is_degenerate()) continue;  // its edges belong to its neighbours too
    tree_->triangles.push_back(triangle);
    tree_->number.push_back(static_cast<std::int32_t>(f));
  }
  tree_->tree.insert(tree_->triangles.cbegin(), tree_->triangles.cend());
  tree_->tree.accelerate_distance_queries();
}

NearestPoint::~NearestPoint() = default;

Vec3 NearestPoint::find(const Vec3& p) const {
  const auto q = tree_->tree.closest_point({p[0], p[1], p[2]});
  return {q.x(), q.y(), q.z()};
}

std::pair<Vec3, std::int32_t> NearestPoint::find_on(const Vec3& p) const {
  const auto [q, triangle] = tree_->tree.closest_point_and_primitive({p[0], p[1], p[2]});
  return {{q.x(), q.y(), q.z()}, tree_->number[static_cast<std::size_t>(triangle - tree_->triangles.cbegin())]};
}

}  // namespace carillon::mesher

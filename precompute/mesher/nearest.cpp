#include "precompute/mesher/nearest.hpp"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

namespace carillon::mesher {

using DoubleKernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<DoubleKernel::Triangle_3>;

struct NearestPoint::Tree {
  Triangles triangles;
  std::vector<std::int32_t> number;  // of each among those of the surface
  CGAL::AABB_tree<CGAL::AABB_traits<DoubleKernel, CGAL::AABB_triangle_primitive<DoubleKernel, Triangles::const_iterator>>> tree;
};

NearestPoint::NearestPoint(const TriangleSurface& surface) : tree_(std::make_unique<Tree>()) {
  const auto point = [&](std::int32_t v) {
    const Vec3& p = surface.points[v];
    return DoubleKernel::Point_3(p[0], p[1], p[2]);
  };
  for (std::size_t f = 0; f < surface.triangles.size(); ++f) {
    const Triangle& t = surface.triangles[f];
    const DoubleKernel::Triangle_3 triangle(point(t[0]), point(t[1]), point(t[2]));
    if (triangle.is_degenerate()) continue;  // its edges belong to neighbours
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
  return {{q.x(), q.y(), q.z()}, tree_->number[triangle - tree_->triangles.cbegin()]};
}

std::optional<std::pair<double, std::int32_t>> NearestPoint::find_hit(const Vec3& from, const Vec3& way, std::int32_t own) const {
  const DoubleKernel::Ray_3 ray(DoubleKernel::Point_3(from[0], from[1], from[2]), DoubleKernel::Vector_3(way[0], way[1], way[2]));
  const auto number_of = [&](auto triangle) { return tree_->number[triangle - tree_->triangles.cbegin()]; };
  const auto hit = tree_->tree.first_intersected_primitive(ray, [&](auto triangle) { return number_of(triangle) == own; });
  if (!hit) return std::nullopt;
  const DoubleKernel::Triangle_3& t = **hit;
  const auto normal = CGAL::cross_product(t[1] - t[0], t[2] - t[0]);
  const double slope = normal * ray.to_vector();
  return std::pair{slope != 0 ? normal * (t[0] - ray.source()) / slope : 0.0, number_of(*hit)};
}

}  // namespace carillon::mesher

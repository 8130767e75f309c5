// The exact distance to a triangle surface; std only, CGAL's AABB tree stays in nearest.cpp.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// A tree of the triangles of a surface. It holds copies, so that the surface may go; find() is exact up to rounding.
class NearestPoint {
 public:
  explicit NearestPoint(const TriangleSurface& surface);
  ~NearestPoint();
  /// The point of the surface nearest to p.
  Vec3 find(const Vec3& p) const;
  /// The same, and its triangle.
  std::pair<Vec3, std::int32_t> find_on(const Vec3& p) const;
  /// The nearest triangle that a ray meets, but `own` (-1: none), and how far away along the unit vector `way`.
  std::optional<std::pair<double, std::int32_t>> find_hit(const Vec3& from, const Vec3& way, std::int32_t own) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace carillon::mesher

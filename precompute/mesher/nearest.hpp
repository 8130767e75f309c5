// Exact distance to a triangle surface; std only, CGAL's AABB tree is confined to nearest.cpp.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Tree of copied triangles (independent of the surface); find() is exact up to rounding.
class NearestPoint {
 public:
  explicit NearestPoint(const TriangleSurface& surface);
  ~NearestPoint();
  /// Nearest point of the surface.
  Vec3 find(const Vec3& p) const;
  /// Nearest point and its triangle.
  std::pair<Vec3, std::int32_t> find_on(const Vec3& p) const;
  /// First triangle hit by a ray, except `own` (-1: none), and its distance along the unit vector `way`.
  std::optional<std::pair<double, std::int32_t>> find_hit(const Vec3& from, const Vec3& way, std::int32_t own) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace carillon::mesher

// Closest point on a body's surface: clicks, collisions, strikes.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Point on the surface.
struct NearestPlace {
  std::int32_t triangle = -1;  // -1: none (no triangles, or a query point that is not finite or beyond kFarthestPointM)
  Vec3 barycentric{};          // weights of the corners, >= 0, sum 1
  Vec3 point_m{};              // mesh axes
  double distance_m = 0.0;     // from the query point
};

/// Largest distance of a point that is given by hand from the surface, relative to the extent of the body, the diagonal of its box: farther
/// ones are mistakes, such as of units.
inline constexpr double kFarthestShare = 0.25;

/// Limit of coordinates: squares must not overflow.
inline constexpr double kFarthestPointM = 1e100;

/// Barycentric coordinates of the point of triangle (a, b, c) closest to p; degenerate triangles permitted.
Vec3 find_nearest_barycentric(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) noexcept;

/// Closest point of a bank's surface by linear search, for few queries. Ties go to the lowest triangle. Thread-safe.
NearestPlace find_nearest(const Bank& bank, const Vec3& point_m) noexcept;

/// The same for many queries: box tree, O(T log T) to build, O(log T) per query. The bank must outlive it and keep its surface. Concurrent
/// find() calls are safe.
class SurfaceTree {
 public:
  explicit SurfaceTree(const Bank& bank);

  /// Same result as find_nearest(). Does not allocate or block.
  NearestPlace find(const Vec3& point_m) const noexcept;

 private:
  struct Box {
    Vec3 low, high;
    // Leaf: range in order_. Inner box: count 0, first: second child; the first child is the next box.
    std::int32_t first = 0, count = 0;
  };
  std::int32_t build(std::vector<Vec3>& centres_m, std::int32_t first, std::int32_t last);

  const Bank* bank_;
  std::vector<Box> boxes_;
  std::vector<std::int32_t> order_;
};

}  // namespace carillon::bank

// Where on a body's surface is nearest to a point: what a click, a collision or a strike hits.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// A place on the surface.
struct NearestPlace {
  std::int32_t triangle = -1;  // -1: there is none (no triangles, or a point that is not finite or beyond kFarthestPointM)
  Vec3 barycentric{};          // of the triangle's corners, at least 0, of sum 1
  Vec3 point_m{};              // the same place, frame of the mesh
  double distance_m = 0.0;     // from the point asked for
};

/// Coordinates beyond this are no places: their squares would not be numbers.
inline constexpr double kFarthestPointM = 1e100;

/// Barycentric coordinates of the point of the triangle (a, b, c) that is nearest to p; also of one without area.
Vec3 find_nearest_barycentric(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) noexcept;

/// The nearest place of a bank's surface by looking at every triangle: for a few points. Of places equally near, that of the lowest
/// triangle. Any thread.
NearestPlace find_nearest(const Bank& bank, const Vec3& point_m) noexcept;

/// The same for many points, by a tree of boxes: O(log T) a point once O(T log T) is spent on the tree. The bank must outlive it and keep
/// its surface. Built on one thread; find() on any number of threads at once.
class SurfaceTree {
 public:
  explicit SurfaceTree(const Bank& bank);

  /// The same place as find_nearest() finds. Takes no memory and does not wait.
  NearestPlace find(const Vec3& point_m) const noexcept;

 private:
  struct Box {
    Vec3 low, high;
    std::int32_t first = 0, count = 0;  // a leaf's triangles in order_; of an inner box count is 0 and first its second child, the
                                        // first child being the next box
  };
  std::int32_t build(std::vector<Vec3>& centres_m, std::int32_t first, std::int32_t last);

  const Bank* bank_;
  std::vector<Box> boxes_;
  std::vector<std::int32_t> order_;
};

}  // namespace carillon::bank

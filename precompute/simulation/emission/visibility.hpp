// Lines of sight past surfaces.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/job/obstacles.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::emission {

using Corners = std::array<Vec3, 3>;  // of a triangle, m

/// True if any part of the segment, including its ends, lies inside the obstacle.
bool is_between(const job::RigidObstacle& obstacle, const Vec3& from, const Vec3& to);

/// Bounding volume hierarchy of triangles. Invariant: results depend on the list of triangles only.
class Visibility {
 public:
  Visibility() = default;
  explicit Visibility(std::span<const Corners> triangles);

  /// True if the segment meets no triangle except `own` (an index, or -1).
  bool is_free(const Vec3& from, const Vec3& to, std::int64_t own) const;

 private:
  struct Box {
    Vec3 low, high;
    std::int32_t first = 0, count = 0;  // of order_, for a leaf
    std::int32_t second = 0;            // the other child; the first follows
  };
  void split(std::size_t begin, std::size_t end);

  std::vector<Corners> triangles_;
  std::vector<std::int32_t> order_;
  std::vector<Box> boxes_;
};

}  // namespace carillon::emission

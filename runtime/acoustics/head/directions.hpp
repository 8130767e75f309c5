// Which three of a set of directions stand around any direction, found at once.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::head {

/// Three directions and their shares: the shares are not negative and sum to 1.
struct Surrounding {
  std::array<int, 3> direction{};
  std::array<double, 3> share{};
};

/// A set of directions around a head as the corners of triangles that cover the sphere (their convex hull). The shares that find() gives
/// are those of the point where the direction goes through its triangle: continuous everywhere, and 1 at a corner.
class Directions {
 public:
  /// Unit vectors, no two of them within kNearestRad. Throws InputError, its message beginning with `name`, where the directions leave
  /// out so much of the sphere that no triangle of them closes it (a gap wider than 2 kWidestRad). Time ~ the square of their number.
  Directions(const std::vector<Vec3>& unit, const std::string& name);

  static constexpr double kNearestRad = 0.0035;  // 0.2 degrees
  static constexpr double kWidestRad = 1.40;     // 80 degrees from the middle of a triangle to its corners

  /// The direction need not have the length 1; one of no length, or that is not finite, counts as (1, 0, 0). A table of kCells x kCells
  /// cells of each side of a cube says where to begin, and a walk of a few triangles ends the search. [audio-thread]
  Surrounding find(const Vec3& direction) const noexcept;

  std::size_t count_triangles() const noexcept { return triangles_.size(); }

 private:
  static constexpr int kCells = 18;  // of an edge of the cube: 5 degrees
  struct Triangle {
    std::array<int, 3> corner{}, neighbour{};  // neighbour i is across from corner i; corners turn to the left, seen from outside
  };
  int walk(const Vec3& direction, int from, std::array<double, 3>& share) const noexcept;
  static std::size_t find_cell(const Vec3& direction) noexcept;

  std::vector<Vec3> unit_;
  std::vector<Triangle> triangles_;
  std::array<int, 6 * kCells * kCells> start_{};  // a triangle near the middle of each cell
};

}  // namespace carillon::head

// Lowest vertex of a rotating body: candidates by direction.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "runtime/physics/geometry/vectors.hpp"

namespace carillon::geometry {

class Shape;

/// For each cell of directions (a square on a face of a cube) the vertices of a mesh that may be lowest along one of them, computed on
/// first use. The result equals that of a search of all vertices.
class LowVertices {
 public:
  /// Lowest vertex along `up` (mesh frame), and its height. All calls must pass the same shape.
  std::pair<int, double> find(const Shape& shape, const Vec3& up);
  /// All vertices that may be lowest along a direction in the cell of `up`.
  const std::vector<int>& list(const Shape& shape, const Vec3& up);

 private:
  static constexpr int kSide = 16;  // cells along a cube edge
  struct Cell {
    int axis = 0, sign = 0;  // cube face: axis, and 1 on its positive side
    std::array<int, 2> rows{};
  };

  static Cell find_cell(const Vec3& up);
  static Vec3 make_way(const Cell& cell, double x, double y);
  static void fill(const Shape& shape, const Cell& cell, std::vector<int>& low);

  std::array<std::vector<int>, 6 * kSide * kSide> low_;
};

}  // namespace carillon::geometry

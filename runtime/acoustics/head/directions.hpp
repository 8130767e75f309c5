// Interpolation over a set of directions: three neighbours and their weights.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::head {

/// Three directions and their weights: not negative, sum 1.
struct Surrounding {
  std::array<int, 3> direction{};
  std::array<double, 3> share{};
};

/// Directions around a head as vertices of their convex hull. Weights are barycentric coordinates of the point where the direction passes
/// through its triangle: continuous, and 1 at a vertex.
class Directions {
 public:
  /// Unit vectors at least kNearestRad apart. Throws InputError (message begins with `name`) if the directions leave a gap wider than 2
  /// kWidestRad. Time ~ square of their number.
  Directions(const std::vector<Vec3>& unit, const std::string& name);

  static constexpr double kNearestRad = 0.0035;  // 0.2 degrees
  static constexpr double kWidestRad = 1.40;     // 80 degrees between the centre of a triangle and its corners

  /// `direction`: any length; zero or non-finite vectors count as (1, 0, 0). Start triangle from a table of kCells x kCells cells per side
  /// of a cube, then a walk over a few triangles. [audio-thread]
  Surrounding find(const Vec3& direction) const noexcept;

  std::size_t count_triangles() const noexcept { return triangles_.size(); }

 private:
  static constexpr int kCells = 18;  // per cube edge: 5 degrees
  struct Triangle {
    std::array<int, 3> corner{}, neighbour{};  // neighbour i is opposite corner i; corners counter-clockwise from outside
  };
  int walk(const Vec3& direction, int from, std::array<double, 3>& share) const noexcept;
  static std::size_t find_cell(const Vec3& direction) noexcept;

  std::vector<Vec3> unit_;
  std::vector<Triangle> triangles_;
  std::array<int, 6 * kCells * kCells> start_{};  // a triangle near the centre of each cell
};

}  // namespace carillon::head

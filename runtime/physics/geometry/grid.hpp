// Sparse grid about a mesh: lower bounds of the distance, and a nearby face.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/physics/geometry/mesh.hpp"

namespace carillon::geometry {

/// Lower bound of the distance to a mesh at any point. `at_least_m` never exceeds the true distance, rounding included.
class Grid {
 public:
  explicit Grid(const Mesh& mesh);

  struct Near {
    double min_m = 0.0;  // lower bound of the distance
    int face = -1;       // a nearby face; -1: far away
  };
  Near find_near(const Vec3& x) const;
  double get_cell_m() const { return cell_m_; }

 private:
  static constexpr int kBrick = 4;  // nodes per side; smaller bricks store fewer nodes far from the surface
  struct Node {
    float distance_m = 0.0F;
    std::int32_t face = -1;
  };
  struct Brick {
    float distance_m = 0.0F;  // of the centre
    std::int32_t first = -1;  // index in nodes_; -1: far from the surface
  };
  Box box_;  // of the mesh
  Vec3 low_{};
  double cell_m_ = 0.0;
  std::array<int, 3> bricks_along_{};
  std::vector<Brick> bricks_;
  std::vector<Node> nodes_;
};

}  // namespace carillon::geometry

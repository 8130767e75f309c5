// A sparse grid about a mesh that gives a lower bound of the distance and a face that is near.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/physics/geometry/mesh.hpp"

namespace carillon::geometry {

/// A lower bound of the distance to a mesh, at any point. `at_least_m` is never more than the true distance, rounding included.
class Grid {
 public:
  explicit Grid(const Mesh& mesh);

  struct Near {
    double min_m = 0.0;  // no face is nearer
    int face = -1;       // one that is near; -1 far away
  };
  Near find_near(const Vec3& x) const;
  double get_cell_m() const { return cell_m_; }

 private:
  static constexpr int kBrick = 4;  // nodes along a side: smaller bricks keep fewer nodes that are far from the surface
  struct Node {
    float distance_m = 0.0F;
    std::int32_t face = -1;
  };
  struct Brick {
    float distance_m = 0.0F;  // of its middle
    std::int32_t first = -1;  // of nodes_; -1: far from the surface
  };
  Box box_;  // of the mesh
  Vec3 low_{};
  double cell_m_ = 0.0;
  std::array<int, 3> bricks_along_{};
  std::vector<Brick> bricks_;
  std::vector<Node> nodes_;
};

}  // namespace carillon::geometry

// Method: bricks of 4^3 nodes near the surface store a distance and a nearby face per node, other bricks the distance of their centre. A
// distance changes by at most the distance moved, so both give bounds that hold everywhere. The search at a node starts from the face of
// the previous node. The grid is only used for searches; distances and signs come from the mesh, so walls thinner than a cell are handled.
#include "runtime/physics/geometry/grid.hpp"

namespace carillon::geometry {
namespace {

constexpr double kGridCells = 48.0;           // along the longest side
constexpr double kBandCells = 1.5;            // cells; width of the band of nodes about the surface
constexpr double kDistanceErrorCells = 0.25;  // cells; accuracy of the distances
constexpr double kRoundDown = 1.0 - 1e-6;

}  // namespace

Grid::Grid(const Mesh& mesh) : box_(mesh.box) {
  const Vec3 side = box_.high - box_.low;
  cell_m_ = std::max({side[0], side[1], side[2]}) / kGridCells;
  const double brick = kBrick * cell_m_, half = 0.5 * std::sqrt(3.0) * brick;
  for (int k = 0; k < 3; ++k) {
    bricks_along_[k] = static_cast<int>(std::ceil((side[k] + 2.0 * cell_m_) / brick));
    low_[k] = 0.5 * (box_.low[k] + box_.high[k]) - 0.5 * bricks_along_[k] * brick;
  }
  int face = 0;
  const auto measure = [&](const Vec3& x) {
    const Nearest nearest = mesh.find_nearest(x, Box::kFar, face, kDistanceErrorCells * cell_m_);
    face = nearest.face;
    return kRoundDown * (std::sqrt(nearest.distance2) - kDistanceErrorCells * cell_m_);
  };
  for (int i = 0; i < bricks_along_[0]; ++i) {
    for (int j = 0; j < bricks_along_[1]; ++j) {
      for (int k = 0; k < bricks_along_[2]; ++k) {
        const Vec3 corner = low_ + Vec3{i * brick, j * brick, k * brick};
        Brick b;
        b.distance_m = static_cast<float>(measure(corner + Vec3{0.5 * brick, 0.5 * brick, 0.5 * brick}));
        if (b.distance_m < half + kBandCells * cell_m_) {
          b.first = static_cast<std::int32_t>(nodes_.size());
          for (int l = 0; l < kBrick; ++l) {
            for (int m = 0; m < kBrick; ++m) {
              for (int o = 0; o < kBrick; ++o) {
                const int n = m % 2 == 0 ? o : kBrick - 1 - o;  // serpentine order: consecutive nodes are neighbours
                const Vec3 x = corner + cell_m_ * Vec3{l + 0.5, m + 0.5, n + 0.5};
                const double distance = measure(x);
                const std::size_t at = b.first + (l * kBrick + m) * kBrick + n;
                if (nodes_.size() <= at) nodes_.resize(b.first + kBrick * kBrick * kBrick);
                nodes_[at] = {static_cast<float>(distance), face};
              }
            }
          }
        }
        bricks_.push_back(b);
      }
    }
  }
}

Grid::Near Grid::find_near(const Vec3& x) const {
  std::array<int, 3> cell{};
  Vec3 inside = x;
  for (int k = 0; k < 3; ++k) {
    const double at = std::clamp((x[k] - low_[k]) / cell_m_, 0.0, kBrick * bricks_along_[k] - 0.5);
    cell[k] = static_cast<int>(at);
    inside[k] = low_[k] + (cell[k] + 0.5) * cell_m_;
  }
  const Brick& brick = bricks_[(cell[0] / kBrick * bricks_along_[1] + cell[1] / kBrick) * bricks_along_[2] + cell[2] / kBrick];
  Near near;
  near.min_m = std::sqrt(box_.calc_distance2(x));
  if (brick.first < 0) {
    Vec3 middle{};
    for (int k = 0; k < 3; ++k) middle[k] = low_[k] + (cell[k] / kBrick + 0.5) * kBrick * cell_m_;
    near.min_m = std::max(near.min_m, brick.distance_m - norm(x - middle));
    return near;
  }
  const Node& node = nodes_[brick.first + ((cell[0] % kBrick) * kBrick + cell[1] % kBrick) * kBrick + cell[2] % kBrick];
  near.min_m = std::max(near.min_m, node.distance_m - norm(x - inside));
  near.face = node.face;
  return near;
}

}  // namespace carillon::geometry

#include "runtime/bank/packed/levels.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "runtime/bank/packed/neighbours.hpp"
#include "runtime/bank/packed/surface.hpp"

namespace carillon::packed {
namespace {

constexpr double kLastShare = 2.7;                // all vertices over those of all levels but the last
constexpr double kVerticesPerSquare = 0.7;        // vertices taken per square of the distance
constexpr std::size_t kMinCoarsestVertices = 64;  // minimum number of vertices of the first level

/// Points with a minimum distance, in cells of that width.
class Darts {
 public:
  explicit Darts(double distance_m) : distance_m_(distance_m) {}
  void add(const Vec3& x) { cells_[hash(find_cell(x))].push_back(x); }
  bool has_near(const Vec3& x) const {
    const Cell centre = find_cell(x);
    for (std::int64_t i = -1; i <= 1; ++i)
      for (std::int64_t j = -1; j <= 1; ++j)
        for (std::int64_t k = -1; k <= 1; ++k) {
          const auto found = cells_.find(hash({centre[0] + i, centre[1] + j, centre[2] + k}));
          if (found == cells_.end()) continue;
          for (const Vec3& y : found->second)
            if (dot(y - x, y - x) < distance_m_ * distance_m_) return true;
        }
    return false;
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  Cell find_cell(const Vec3& x) const {
    Cell cell;
    for (std::size_t k = 0; k < 3; ++k) cell[k] = static_cast<std::int64_t>(std::floor(x[k] / distance_m_));
    return cell;
  }
  /// Cells of equal hash share a bucket.
  static std::uint64_t hash(const Cell& cell) {
    return static_cast<std::uint64_t>(cell[0]) * 0x9e3779b97f4a7c15U ^ static_cast<std::uint64_t>(cell[1]) * 0xc2b2ae3d27d4eb4fU ^
           static_cast<std::uint64_t>(cell[2]) * 0x165667b19e3779f9U;
  }

  double distance_m_;
  std::unordered_map<std::uint64_t, std::vector<Vec3>> cells_;
};

}  // namespace

std::vector<std::uint8_t> find_levels(std::span<const Vec3> vertices_m, double area_m2) {
  // Distances from the finest level up, then levels from the coarsest down.
  std::vector<double> distances_m;
  for (double count = static_cast<double>(vertices_m.size()) / kLastShare;
       count >= static_cast<double>(kMinCoarsestVertices) && distances_m.size() + 1 < kMaxLevels; count /= 4.0)
    distances_m.push_back(std::sqrt(kVerticesPerSquare * area_m2 / count));
  constexpr std::uint8_t kNone = std::numeric_limits<std::uint8_t>::max();
  std::vector<std::uint8_t> level(vertices_m.size(), kNone);
  std::size_t taken = 0;
  std::uint8_t next = 0;
  for (; !distances_m.empty(); distances_m.pop_back()) {
    Darts darts(distances_m.back());
    std::vector<std::size_t> added;
    for (std::size_t v = 0; v < vertices_m.size(); ++v)
      if (level[v] != kNone) darts.add(vertices_m[v]);
    for (std::size_t v = 0; v < vertices_m.size(); ++v) {
      if (level[v] != kNone || darts.has_near(vertices_m[v])) continue;
      darts.add(vertices_m[v]);
      added.push_back(v);
    }
    if (added.empty() || taken + added.size() < kNeighbours) continue;
    for (const std::size_t v : added) level[v] = next;
    taken += added.size();
    ++next;
  }
  if (taken < vertices_m.size()) std::replace(level.begin(), level.end(), kNone, next);
  return level;
}

}  // namespace carillon::packed

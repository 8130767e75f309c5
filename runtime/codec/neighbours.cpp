// Method: cells of a lattice, in buckets by a hash. The cells about a vertex are looked at ring by ring, until none further out can hold a
//   nearer one; where two rings do not suffice, wider cells are looked at.
#include "runtime/codec/neighbours.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>

namespace carillon::codec {
namespace {

constexpr double kPerCell = 4.0;  // vertices of a cell, where the surface passes it
constexpr std::int32_t kRings = 2;
constexpr int kWider = 2;  // log2

std::uint32_t mix(const Place& cell) {
  std::uint32_t hash = static_cast<std::uint32_t>(cell[0]) * 0x9e3779b1U;
  hash = (hash ^ (hash >> 15) ^ static_cast<std::uint32_t>(cell[1])) * 0x85ebca77U;
  hash = (hash ^ (hash >> 13) ^ static_cast<std::uint32_t>(cell[2])) * 0xc2b2ae3dU;
  return hash ^ (hash >> 16);
}

Place find_cell(const Place& place, int shift) { return {place[0] >> shift, place[1] >> shift, place[2] >> shift}; }

/// The sides of the box around them, in steps, at least 1.
std::array<double, 3> calc_box(std::span<const Place> places) {
  std::array<double, 3> size{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] = std::minmax_element(places.begin(), places.end(), [&](const Place& a, const Place& b) { return a[k] < b[k]; });
    size[k] = static_cast<double>((*high)[k]) - (*low)[k] + 1.0;
  }
  return size;
}

using Candidate = std::pair<std::int64_t, std::int32_t>;  // square of the distance, vertex

/// The nearest so far, ascending.
class Nearest {
 public:
  Nearest() { candidates_.fill({std::numeric_limits<std::int64_t>::max(), -1}); }
  void take(const Candidate& candidate) {
    if (!(candidate < candidates_.back())) return;
    std::size_t i = kNeighbours - 1;
    for (; i > 0 && candidate < candidates_[i - 1]; --i) candidates_[i] = candidates_[i - 1];
    candidates_[i] = candidate;
  }
  std::int64_t get_farthest() const { return candidates_.back().first; }
  /// Where too few were found, the first vertices of all.
  Neighbours get_vertices() const {
    Neighbours vertices;
    for (std::size_t i = 0; i < kNeighbours; ++i)
      vertices[i] = candidates_[i].second >= 0 ? candidates_[i].second : static_cast<std::int32_t>(i);
    return vertices;
  }

 private:
  std::array<Candidate, kNeighbours> candidates_;
};

std::int64_t calc_square(const Place& a, const Place& b) {
  std::int64_t sum = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::int64_t d = std::int64_t{a[k]} - b[k];
    sum += d * d;
  }
  return sum;
}

/// Calls look(cell) for the cells that are `ring` cells away.
template <class Look>
void for_each_of_ring(const Place& centre, std::int32_t ring, Look&& look) {
  for (std::int32_t x = -ring; x <= ring; ++x) {
    for (std::int32_t y = -ring; y <= ring; ++y) {
      const bool is_side = std::abs(x) == ring || std::abs(y) == ring;
      for (std::int32_t z = -ring; z <= ring; z += is_side ? 1 : 2 * ring) look({centre[0] + x, centre[1] + y, centre[2] + z});
    }
  }
}

}  // namespace

int find_cell_shift(std::span<const Place> places) {
  const auto [a, b, c] = calc_box(places);
  const double width = std::sqrt(kPerCell * 2.0 * (a * b + b * c + c * a) / static_cast<double>(places.size()));
  return std::clamp(static_cast<int>(std::lround(std::log2(width))), 0, kMaxCellShift);
}

NeighbourSearch::NeighbourSearch(std::span<const Place> known, int cell_shift) : known_(known) {
  const std::array<double, 3> box = calc_box(known);
  const double extent = *std::max_element(box.begin(), box.end());
  std::vector<std::uint32_t> bucket(known.size());
  for (int shift = cell_shift; grids_.empty() || std::ldexp(1.0, grids_.back().shift) < extent; shift += kWider) {
    Grid grid;
    grid.shift = std::min(shift, kMaxCellShift + 2);
    grid.begin.assign(std::bit_ceil(known.size()) + 1, 0);
    for (std::size_t v = 0; v < known.size(); ++v) {
      bucket[v] = mix(find_cell(known[v], grid.shift)) & static_cast<std::uint32_t>(grid.begin.size() - 2);
      ++grid.begin[bucket[v] + 1];
    }
    std::partial_sum(grid.begin.begin(), grid.begin.end(), grid.begin.begin());
    grid.vertices.resize(known.size());
    std::vector<std::uint32_t> next(grid.begin.begin(), grid.begin.end() - 1);
    for (std::size_t v = 0; v < known.size(); ++v) grid.vertices[next[bucket[v]]++] = static_cast<std::int32_t>(v);
    grids_.push_back(std::move(grid));
  }
}

Neighbours NeighbourSearch::find(const Place& place) const {
  Nearest nearest;
  for (const Grid& grid : grids_) {
    const Place centre = find_cell(place, grid.shift);
    // Steps to the nearest side of the cell that it is in; a ring further out, every cell adds its width.
    std::int64_t inside = std::numeric_limits<std::int64_t>::max();
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int64_t low = place[k] - (std::int64_t{centre[k]} << grid.shift);
      inside = std::min({inside, low, (std::int64_t{1} << grid.shift) - 1 - low});
    }
    nearest = {};
    for (std::int32_t ring = 0; ring <= kRings; ++ring) {
      for_each_of_ring(centre, ring, [&](const Place& cell) {
        const std::uint32_t bucket = mix(cell) & static_cast<std::uint32_t>(grid.begin.size() - 2);
        const std::uint32_t first = grid.begin[bucket], last = std::min(grid.begin[bucket + 1], first + kMostOfCell);
        for (std::uint32_t i = first; i < last; ++i) {
          const std::int32_t v = grid.vertices[i];
          const Place& other = known_[static_cast<std::size_t>(v)];
          if (find_cell(other, grid.shift) == cell) nearest.take({calc_square(place, other), v});
        }
      });
      const std::int64_t reach = (std::int64_t{ring} << grid.shift) + inside;  // whatever is further out is further than this
      if (nearest.get_farthest() <= reach * reach) return nearest.get_vertices();
    }
  }
  return nearest.get_vertices();
}

}  // namespace carillon::codec

// Method: lattice cells in hash buckets. 2x2x2 cells contain all vertices within half a cell width and most within one: prediction needs
//   good neighbours on which reader and writer agree, not the exact nearest ones.
#include "runtime/bank/packed/neighbours.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "runtime/bank/packed/loops.hpp"

namespace carillon::packed {
namespace {

constexpr double kVerticesPerCell = 1.5;          // mean vertices of a cell that the surface crosses
constexpr int kMaxGridShift = kMaxCellShift + 2;  // two cells of this width cover the lattice

std::uint32_t mix(const Place& cell) {
  std::uint32_t hash = static_cast<std::uint32_t>(cell[0]) * 0x9e3779b1U;
  hash = (hash ^ (hash >> 15) ^ static_cast<std::uint32_t>(cell[1])) * 0x85ebca77U;
  hash = (hash ^ (hash >> 13) ^ static_cast<std::uint32_t>(cell[2])) * 0xc2b2ae3dU;
  return hash ^ (hash >> 16);
}

Place find_cell(const Place& place, int shift) { return {place[0] >> shift, place[1] >> shift, place[2] >> shift}; }

/// Sides of the bounding box, in steps, at least 1.
std::array<double, 3> calc_box(std::span<const Place> places) {
  std::array<double, 3> size{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] = std::minmax_element(places.begin(), places.end(), [&](const Place& a, const Place& b) { return a[k] < b[k]; });
    size[k] = static_cast<double>((*high)[k]) - (*low)[k] + 1.0;
  }
  return size;
}

}  // namespace

int find_cell_shift(std::span<const Place> places) {
  const auto [a, b, c] = calc_box(places);
  const double width = std::sqrt(kVerticesPerCell * 2.0 * (a * b + b * c + c * a) / static_cast<double>(places.size()));
  return std::clamp(static_cast<int>(std::lround(std::log2(width))), 0, kMaxCellShift);
}

static_assert(8 * NeighbourSearch::kMostOfCell <= Near::kMost);

NeighbourSearch::NeighbourSearch(std::span<const Place> known, int cell_shift)
    : loops_(find_loops()), known_(known), cell_shift_(cell_shift), near_(std::make_unique<Near>()) {}
NeighbourSearch::~NeighbourSearch() = default;

NeighbourSearch::Grid NeighbourSearch::make_grid(int shift) const {
  Grid grid;
  grid.shift = shift;
  grid.begin.assign(std::bit_ceil(known_.size()) + 1, 0);
  const auto last_bucket = static_cast<std::uint32_t>(grid.begin.size() - 2);
  std::vector<std::uint32_t> bucket(known_.size());
  for (std::size_t v = 0; v < known_.size(); ++v) {
    bucket[v] = mix(find_cell(known_[v], shift)) & last_bucket;
    ++grid.begin[bucket[v] + 1];
  }
  std::partial_sum(grid.begin.begin(), grid.begin.end(), grid.begin.begin());
  grid.entries.resize(known_.size());
  std::vector<std::uint32_t> next(grid.begin.begin(), grid.begin.end() - 1);
  for (std::size_t v = 0; v < known_.size(); ++v) grid.entries[next[bucket[v]]++] = {known_[v], static_cast<std::int32_t>(v)};
  return grid;
}

/// Gathers the 2x2x2 cells from `low` into near_.
void NeighbourSearch::gather(const Grid& grid, const Place& low) {
  std::size_t& count = near_->count;
  count = 0;
  for (std::int32_t corner = 0; corner < 8; ++corner) {
    const Place cell{low[0] + (corner & 1), low[1] + (corner >> 1 & 1), low[2] + (corner >> 2)};
    const std::uint32_t bucket = mix(cell) & static_cast<std::uint32_t>(grid.begin.size() - 2);
    const std::uint32_t first = grid.begin[bucket], last = std::min(grid.begin[bucket + 1], first + kMostOfCell);
    for (std::uint32_t i = first; i < last; ++i) {
      const Entry& entry = grid.entries[i];
      if (find_cell(entry.place, grid.shift) != cell) continue;
      near_->x[count] = entry.place[0];
      near_->y[count] = entry.place[1];
      near_->z[count] = entry.place[2];
      near_->vertex[count++] = entry.vertex;
    }
  }
}

Neighbours NeighbourSearch::find(const Place& place) {
  for (std::size_t g = 0;; ++g) {
    if (g == grids_.size()) grids_.push_back(make_grid(cell_shift_ + static_cast<int>(g)));
    const Grid& grid = grids_[g];
    const std::int32_t half = grid.shift > 0 ? 1 << (grid.shift - 1) : 0;
    const Place low = find_cell({place[0] - half, place[1] - half, place[2] - half}, grid.shift);
    if (g != near_grid_ || low != near_low_) {
      gather(grid, low);
      near_grid_ = g;
      near_low_ = low;
    }
    Neighbours found;
    if (near_->count >= kNeighbours) {
      loops_.find_nearest(*near_, place, grid.shift + 2, found);  // at most 1.5 cells away
      return found;
    }
    if (grid.shift < kMaxGridShift) continue;
    std::iota(found.begin(), found.end(), 0);  // truncated bucket: any will do
    return found;
  }
}

}  // namespace carillon::packed

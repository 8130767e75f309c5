// Neighbours of a vertex on coarser levels.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "runtime/bank/packed/surface.hpp"

namespace carillon::packed {

/// Number of vertices that predict a shape.
inline constexpr std::size_t kNeighbours = 10;

using Neighbours = std::array<std::int32_t, kNeighbours>;

/// Cell width, as a power of two of steps, for a few vertices per cell; 0 to kMaxCellShift.
int find_cell_shift(std::span<const Place> places);
inline constexpr int kMaxCellShift = 24;

struct Near;
struct Loops;

/// Search among the first vertices of a surface: at least kNeighbours, which must outlive it.
class NeighbourSearch {
 public:
  /// cell_shift: from find_cell_shift(). Results depend on it only: distances are integers on all machines.
  NeighbourSearch(std::span<const Place> known, int cell_shift);
  ~NeighbourSearch();

  /// The kNeighbours closest vertices in the 2x2x2 cells about a place, ascending by distance; ties by cell, then by index. If there are
  /// fewer, the cell width doubles, and so on. Only the first kMostOfCell of a bucket (the coarsest levels) are considered, which bounds
  /// the time.
  Neighbours find(const Place& place);

  NeighbourSearch(const NeighbourSearch&) = delete;
  NeighbourSearch& operator=(const NeighbourSearch&) = delete;

  static constexpr std::uint32_t kMostOfCell = 16;

 private:
  /// Vertex and its position.
  struct Entry {
    Place place{};
    std::int32_t vertex = 0;
  };
  /// Cells of one width in hash buckets.
  struct Grid {
    int shift = 0;
    std::vector<std::uint32_t> begin;  // (buckets + 1)
    std::vector<Entry> entries;        // by bucket, ascending; cells of equal hash share a bucket
  };
  Grid make_grid(int shift) const;
  void gather(const Grid& grid, const Place& low);

  const Loops& loops_;
  std::span<const Place> known_;
  int cell_shift_;
  std::unique_ptr<Near> near_;  // cached 2x2x2 cells from near_low_ of this grid, often shared by the next query
  Place near_low_{};
  std::size_t near_grid_ = std::numeric_limits<std::size_t>::max();
  std::vector<Grid> grids_;  // cell width doubles from grid to grid; built on demand
};

}  // namespace carillon::packed

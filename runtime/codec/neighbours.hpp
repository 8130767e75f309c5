// Which vertices of the coarser levels are near to a vertex.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/codec/surface.hpp"

namespace carillon::codec {

/// Shapes are predicted from so many vertices.
inline constexpr std::size_t kNeighbours = 12;

using Neighbours = std::array<std::int32_t, kNeighbours>;

/// The width of cells, as a power of two of steps, that hold a few places each; 0 to kMaxCellShift.
int find_cell_shift(std::span<const Place> places);
inline constexpr int kMaxCellShift = 24;

/// The first places of a surface, to be searched; kNeighbours or more, and they must outlive it.
class NeighbourSearch {
 public:
  /// cell_shift: as find_cell_shift() gives it. What is found depends on it and on nothing else of the machine: distances are integers.
  NeighbourSearch(std::span<const Place> known, int cell_shift);

  /// The kNeighbours nearest, the nearest first; of places equally near, that of the lowest number. In crowds only the first kMostOfCell of
  /// a cell count, which are of the coarsest levels, so that no surface makes it slow.
  Neighbours find(const Place& place) const;

  static constexpr std::uint32_t kMostOfCell = 32;

 private:
  /// Cells of one width.
  struct Grid {
    int shift = 0;
    std::vector<std::uint32_t> begin;    // (buckets + 1)
    std::vector<std::int32_t> vertices;  // by bucket, ascending; cells of one hash share a bucket
  };
  std::span<const Place> known_;
  std::vector<Grid> grids_;  // each of cells four times as wide as those of the one before, until two hold everything
};

}  // namespace carillon::codec

// Which vertices of the coarser levels are near to a vertex.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "runtime/bank/packed/surface.hpp"

namespace carillon::packed {

/// Shapes are predicted from so many vertices.
inline constexpr std::size_t kNeighbours = 10;

using Neighbours = std::array<std::int32_t, kNeighbours>;

/// The width of cells, as a power of two of steps, that hold a few places each; 0 to kMaxCellShift.
int find_cell_shift(std::span<const Place> places);
inline constexpr int kMaxCellShift = 24;

struct Near;

/// The first places of a surface, to be searched; kNeighbours or more, and they must outlive it.
class NeighbourSearch {
 public:
  /// cell_shift: as find_cell_shift() gives it. What is found depends on it and on nothing else of the machine: distances are integers.
  NeighbourSearch(std::span<const Place> known, int cell_shift);
  ~NeighbourSearch();

  /// The kNeighbours nearest of those in the two by two by two cells about a place, the nearest first; of places equally near, that
  /// of the cell that comes first and in it of the lowest number. Where these cells hold fewer, cells twice as wide are looked at, and so
  /// on. In crowds only the first kMostOfCell of a bucket count, which are of the coarsest levels, so that no surface makes it slow.
  Neighbours find(const Place& place);

  NeighbourSearch(const NeighbourSearch&) = delete;
  NeighbourSearch& operator=(const NeighbourSearch&) = delete;

  static constexpr std::uint32_t kMostOfCell = 16;

 private:
  /// A vertex at its place.
  struct Entry {
    Place place{};
    std::int32_t vertex = 0;
  };
  /// Cells of one width, in buckets by a hash.
  struct Grid {
    int shift = 0;
    std::vector<std::uint32_t> begin;  // (buckets + 1)
    std::vector<Entry> entries;        // by bucket, ascending; cells of one hash share a bucket
  };
  Grid make_grid(int shift) const;
  void gather(const Grid& grid, const Place& low);

  std::span<const Place> known_;
  int cell_shift_;
  std::unique_ptr<Near> near_;  // of eight cells, which the next place often has too: those from near_low_ on of this grid
  Place near_low_{};
  std::size_t near_grid_ = std::numeric_limits<std::size_t>::max();
  std::vector<Grid> grids_;  // each of cells twice as wide as those of the one before; made when they are needed
};

}  // namespace carillon::packed

// Plan of a rank: its fronts, their order, and the messages of factorisation and solves.
#pragma once

#include <petscmat.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "precompute/ldlt/factor.hpp"
#include "precompute/ldlt/node_links.hpp"
#include "precompute/ldlt/room.hpp"
#include "precompute/ldlt/symbolic.hpp"
#include "precompute/ldlt/tile_map.hpp"

namespace carillon::ldlt {

/// Partial sums of right-hand sides from a child of a shared front to its parent, and solutions in the opposite direction.
struct SumMessage {
  int rank = -1;
  std::int32_t child = 0;  // id of the child front
  Ints slots;
};

/// A front owned by this rank alone. Pivots and rows are local nodes.
struct Front : Supernode {
  Ints children;                    // own fronts, in order of assembly
  std::int32_t shared_parent = -1;  // parent if it is a shared front, and index among its children; `parent` is -1 then
  std::int32_t place_in_parent = -1;
  std::vector<SumMessage> to_parent;  // sums collected by the shared parent
  std::int32_t depth = 0;             // below its root; the parity selects the stack of its contribution block
};

/// A child of a shared front, as known to all ranks of the parent: its ranks, and its rows in the parent.
struct SharedChild {
  TileMap map;
  std::int32_t width = 0;
  Ints node_of_row;                    // (rows) node in the parent, ascending
  std::vector<std::int64_t> arriving;  // (its places) numbers of its contribution block sent from there to this rank
  std::int32_t front = -1;             // index among this rank's own fronts, or -1
  std::int32_t shared = -1;            // index among its shared fronts, or -1
};

/// Rows a_begin to a_end and columns b_begin to b_end of a contribution block, in nodes, that lie in one tile of the child and one tile of
/// the parent. On the diagonal a_begin equals b_begin, and only the lower triangle counts.
struct Piece {
  std::int32_t a_begin, a_end, b_begin, b_end;

  /// First row of column c, numbered in the contribution block.
  std::int64_t find_first_row(std::int64_t c) const { return a_begin == b_begin ? c : std::int64_t{3} * a_begin; }
  std::int64_t count() const {
    const std::int64_t rows = 3 * std::int64_t{a_end - a_begin};
    return a_begin == b_begin ? rows * (rows + 1) / 2 : rows * 3 * (b_end - b_begin);
  }
};

/// A front stored in tiles on several ranks.
struct SharedFront {
  SharedFront(std::int32_t id, std::int32_t width, TileMap map, int rank, std::int32_t first_slot);

  std::int32_t id = 0;  // among all fronts
  std::int32_t width = 0;
  TileMap map;
  int place = 0;             // of this rank in the map
  std::int32_t parent = -1;  // index among the shared fronts; the root has none
  std::int32_t place_in_parent = -1;
  std::vector<SharedChild> children;
  std::vector<int> column_tiles;                // tile columns in which this rank has tiles
  Ints row_begin;                               // (tiles + 1) own nodes before each tile
  std::int32_t first_slot = 0;                  // of its rows in the workspace of the solves
  std::vector<int> last_columns;                // (places) last tile column in which each place has a tile, -1: none
  std::vector<std::vector<int>> row_places;     // (pivot tiles) TileMap::list_row
  std::vector<std::vector<int>> column_places;  // (pivot tiles) TileMap::list_column
  std::vector<SumMessage> from_children;        // partial sums of child ranks for rows collected here, in the order of arrival
  std::vector<SumMessage> to_parent;            // partial sums of this rank for rows behind the pivots, by collecting rank

  std::int32_t own_nodes() const { return row_begin.back(); }
  /// Stored numbers of tile column j, which must be one of this rank's.
  std::int64_t count_column(int j) const { return 9 * std::int64_t{map.nodes(j)} * (own_nodes() - row_begin[j]); }
  /// Stored numbers of the tiles in the pivot columns, and in the columns behind.
  std::int64_t count_pivot_columns() const { return count_columns(0, map.pivot_tiles()); }
  std::int64_t count_update() const { return count_columns(map.pivot_tiles(), map.tiles()); }
  /// Index of tile j in column_tiles; pre: it is contained.
  std::size_t find_column_tile(int j) const { return std::lower_bound(column_tiles.begin(), column_tiles.end(), j) - column_tiles.begin(); }
  /// True if a place has tiles behind panel k.
  bool is_updated(int by_place, int k) const { return last_columns[by_place] > k; }

 private:
  std::int64_t count_columns(int begin, int end) const {
    std::int64_t numbers = 0;
    for (const int j : column_tiles)
      if (j >= begin && j < end) numbers += count_column(j);
    return numbers;
  }
};

/// Calls visit(piece) for all pieces that place `from` of a child sends to place `to` of its parent, in the order used by both.
template <typename Visit>
void for_pieces(const SharedChild& child, int from, const TileMap& parent, int to, Visit&& visit) {
  const TileMap& map = child.map;
  const auto rows = static_cast<std::int32_t>(child.node_of_row.size());
  // Runs of rows in one tile of the child and of the parent.
  struct Group {
    std::int32_t begin;
    int tile, parent_tile;
  };
  std::vector<Group> groups;
  for (std::int32_t a = 0; a < rows; ++a) {
    const int tile = map.find_tile(child.width + a);
    const int parent_tile = parent.find_tile(child.node_of_row[a]);
    if (groups.empty() || groups.back().tile != tile || groups.back().parent_tile != parent_tile) groups.push_back({a, tile, parent_tile});
  }
  for (std::size_t b = 0; b < groups.size(); ++b) {
    if (!map.has_column(from, groups[b].tile) || !parent.has_column(to, groups[b].parent_tile)) continue;
    const std::int32_t b_end = b + 1 < groups.size() ? groups[b + 1].begin : rows;
    for (std::size_t a = b; a < groups.size(); ++a)
      if (map.has_row(from, groups[a].tile) && parent.has_row(to, groups[a].parent_tile))
        visit(Piece{groups[a].begin, a + 1 < groups.size() ? groups[a + 1].begin : rows, groups[b].begin, b_end});
  }
}

/// Calls visit(row) for each row of a child with a partial sum on place `from` that is collected on place `to` of the parent.
template <typename Visit>
void for_sums(const SharedChild& child, int from, const TileMap& parent, int to, Visit&& visit) {
  for (std::size_t a = 0; a < child.node_of_row.size(); ++a)
    if (child.map.has_row(from, child.map.find_tile(child.width + static_cast<std::int32_t>(a))) &&
        parent.home(parent.find_tile(child.node_of_row[a])) == to)
      visit(static_cast<std::int32_t>(a));
}

/// 3x3 blocks of A sent from the owner of a matrix row to a rank that eliminates it, in the order used by both.
struct SentBlocks {
  int rank = -1;
  Ints columns;  // own nodes
  Ints rows;     // own nodes and ghosts
};
struct ReceivedBlocks {
  /// Block of a shared front, in its nodes; row -1: the tile is on another rank.
  struct Shared {
    std::int32_t front, column, row;
  };
  int rank = -1;
  Ints columns;  // local nodes, ascending
  Ints rows;
  std::vector<Shared> shared;  // following those, fronts ascending
  std::size_t count() const { return columns.size() + shared.size(); }
};

/// Rows of right-hand sides that are eliminated on another rank than the owner of the matrix row.
struct GivenRows {
  int rank = -1;
  std::int32_t first_slot = 0;
  std::int32_t count = 0;
};
struct TakenRows {
  int rank = -1;
  Ints slots;
};

inline constexpr int kSolveColumns = 32;  // right-hand sides per pass
inline constexpr int kBlockColumns = 16;  // columns per block of right-hand sides

/// Local nodes are numbered in elimination order: first the pivots of this rank's own fronts, then the remaining nodes. Slots are rows of
/// right-hand sides, three per node: of the local nodes, of the rows of shared fronts, and of nodes that other ranks eliminate.
struct Plan {
  MPI_Comm comm = MPI_COMM_NULL;
  int rank = 0;
  std::int32_t own_nodes = 0;  // node rows of the matrix
  std::int32_t pivot_nodes = 0;
  std::int32_t local_nodes = 0;
  std::int32_t given_slots = 0;  // first slot of rows sent to other ranks
  std::int32_t slots = 0;
  Ints slot_of_own;                 // (own_nodes)
  Ints node_of_link;                // (own nodes and ghosts) local node, -1: none
  Ints own_of_pivot;                // (pivot_nodes) own node of the pivot, -1: the row is on another rank
  Ints link_of_ghost_k;             // (ghost columns of K) index among own nodes and ghosts
  Ints link_of_ghost_m;             // the same for M
  std::vector<Front> fronts;        // in postorder
  std::vector<SharedFront> shared;  // in the processing order of all ranks, children before parents
  std::vector<SentBlocks> sent;
  std::vector<ReceivedBlocks> received;
  std::vector<GivenRows> given;
  std::vector<TakenRows> taken;
  Room room;
  Analysis analysis;

  /// Numbers of a block of right-hand sides.
  std::int64_t count_block() const { return std::int64_t{3 * kBlockColumns} * slots; }
};

/// Makes the plan. order: as for Factor. Collective; throws as the constructor of Factor.
Plan make_plan(Mat stiffness, Mat mass, const MeshOrder* order);

}  // namespace carillon::ldlt

// Who eliminates what, in which order, and which messages that takes.
#pragma once

#include <petscmat.h>

#include <cstdint>
#include <vector>

#include "precompute/ldlt/factor.hpp"
#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/symbolic.hpp"

namespace carillon::ldlt {

using Ints = std::vector<std::int32_t>;

/// An update matrix that comes from or goes to another rank.
struct Edge {
  int rank = -1;
  int tag = 0;
  Ints rows;  // local nodes, ascending (of a child); empty for what goes to a parent
};

/// A front on this rank. Pivots and rows are local nodes.
struct Front : Supernode {
  Ints children;                      // fronts of this rank, in order of assembly
  std::vector<Edge> remote_children;  // after them
  Edge to_parent;                     // rank >= 0: the parent lives there
  std::int32_t depth = 0;             // below its root among the subdomain fronts; the parity picks the stack of its update matrix
  bool is_separator = false;
};

/// What happens at one supernode of the separator during the solves: its owner collects what other ranks have added to its pivots, and
/// gives them the solution there.
struct SolveExchange {
  std::int32_t front = -1;  // on the owner
  int owner = -1;           // elsewhere: the rank to send to
  int tag = 0;
  struct Participant {
    int rank = -1;
    Ints nodes;  // local nodes
  };
  std::vector<Participant> participants;  // on the owner
  Ints nodes;                             // elsewhere: local nodes among the pivots
};

/// 3x3 blocks of A between separator nodes on their way from the rank of the column to the owner of its front. Local nodes of this rank,
/// columns ascending, rows ascending in a column.
struct BlockList {
  int rank = -1;  // to or from
  Ints columns;
  Ints rows;
};

/// Local nodes are numbered in order of elimination: first this rank's subdomain nodes, then those separator nodes with which it has to do.
struct Plan {
  MPI_Comm comm = MPI_COMM_NULL;
  int rank = 0;
  std::int32_t own_nodes = 0;
  std::int32_t subdomain_nodes = 0;
  std::int32_t local_nodes = 0;
  Ints node_of_own;           // (own_nodes) local node of each node of this rank
  Ints node_of_ghost_k;       // (ghost columns of K) local node, -1: none
  Ints node_of_ghost_m;       // the same for M
  std::vector<Front> fronts;  // subdomain ones in postorder, then own ones of the separator
  std::int32_t subdomain_fronts = 0;
  std::vector<SolveExchange> exchanges;  // in order of the separator: of own fronts and of those where this rank is a participant
  std::vector<BlockList> sent;
  std::vector<BlockList> received;
  std::int64_t stack_entries[2] = {0, 0};  // the most that update matrices of subdomain fronts of even and odd depth take
  Analysis analysis;
};

/// Plans everything. Collective; throws as Factor's constructor.
Plan make_plan(Mat stiffness, Mat mass);

/// Pivot nodes eliminated at a time, and how `width` pivot nodes are cut into such panels.
inline constexpr std::int32_t kPanelNodes = 24;
inline std::int32_t count_panels(std::int32_t width) { return (width + kPanelNodes - 1) / kPanelNodes; }
/// First pivot node of panel p. Panels are nearly equal; all but the first have a multiple of 4 nodes, so that tiles of 12 rows behind a
/// panel also begin where the update matrix does.
inline std::int32_t find_panel_start(std::int32_t width, std::int32_t p) {
  const std::int64_t quads = (static_cast<std::int64_t>(width) + 3) / 4;
  const std::int32_t panels = count_panels(width);
  return p == 0 ? 0 : width - 4 * static_cast<std::int32_t>(quads * (panels - p) / panels);
}
/// Numbers stored of a front: of each panel a triangle and the rows below.
std::int64_t count_stored(std::int32_t width, std::int32_t size);
/// Room for the W of one of its panels.
std::int64_t count_wide(const Front& front);

/// Where strip b of an update matrix of r rows begins.
inline std::int64_t find_strip(std::int64_t r, std::int64_t b) { return kStripColumns * (b * r - kStripColumns * (b * (b - 1) / 2)); }
/// Numbers stored of it.
inline std::int64_t count_update(std::int64_t r) {
  const std::int64_t whole = r / kStripColumns;
  const std::int64_t rest = r - whole * kStripColumns;
  return find_strip(r, whole) + rest * rest;
}
/// Where row 0 of column j would be.
inline std::int64_t find_update_column(std::int64_t r, std::int64_t j) {
  const std::int64_t first = j / kStripColumns * kStripColumns;
  return find_strip(r, j / kStripColumns) + (j - first) * (r - first) - first;
}

}  // namespace carillon::ldlt

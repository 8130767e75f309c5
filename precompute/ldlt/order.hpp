// Elimination order of the nodes: a tree of separators over the ranks.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/ldlt/node_links.hpp"

namespace carillon::ldlt {

/// A part of the tree: the leaf of a rank, or the separator between two subtrees. Covers leaves begin to end - 1; rank `begin` holds the
/// nodes and fronts of the part until they are distributed.
struct TreePart {
  int begin = 0;
  int end = 1;
  int parent = -1;
  int left = -1;  // parts below a separator
  int right = -1;
  int depth = 0;
  std::int32_t first = 0;  // position of its first node in the elimination order
  std::int32_t count = 0;
  std::int32_t first_front = 0;
  bool is_leaf() const { return end - begin == 1; }
};

/// All parts, children before parents; the same on every rank.
class SeparatorTree {
 public:
  /// One leaf per rank, no nodes.
  explicit SeparatorTree(int ranks);

  std::vector<TreePart> parts;
  std::int32_t fronts = 0;

  const TreePart& operator[](int part) const { return parts[part]; }
  int root() const { return static_cast<int>(parts.size()) - 1; }
  /// Depth of the lowest leaf.
  int depth() const { return depth_; }
  /// True if a part is in the left subtree of a separator above it.
  bool is_left_of(int part, int above) const { return (*this)[part].end <= (*this)[(*this)[above].right].begin; }
  /// Lowest common ancestor, possibly a or b.
  int find_common(int a, int b) const;
  /// Part of a position in the elimination order.
  int find_part(std::int32_t position) const;
  int find_holder(std::int32_t position) const { return (*this)[find_part(position)].begin; }

 private:
  int add(int begin, int end, int depth);
  int depth_ = 0;
};

/// Nodes (global numbers) of each part held by this rank, in elimination order. Sets first and count of the parts. Parts of up to
/// `largest_gathered` nodes are gathered on one rank and cut there; larger ones are cut by their quotient graph without gathering.
/// dominated_per_edge: of the core of a CompressedGraph, the same on all ranks. Collective. Throws SystemError on all ranks if memory runs
/// out.
std::vector<Ints> order_parts(const comm::Communicator& comm, const NodeLinks& nodes, const comm::IndexPartition& owners,
                              SeparatorTree& tree, std::int32_t largest_gathered, std::optional<double> dominated_per_edge = {});

}  // namespace carillon::ldlt

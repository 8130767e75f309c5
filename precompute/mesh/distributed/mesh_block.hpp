// Block of a distributed mesh: a contiguous range of elements and one of nodes.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/comm/index_partition.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesh {

/// A range of nodes and a range of elements, generally unrelated. Nodes are numbered over the whole mesh: corners of the file first, then
/// added mid nodes; each kind is contiguous per rank. nodes_m and fixed contain this rank's corners, then its mids.
struct MeshBlock {
  int order = 1;
  comm::IndexPartition corners;     // ownership of the used nodes of the file
  comm::IndexPartition mids;        // ownership of added nodes, numbered from corners.total()
  std::vector<Vec3> nodes_m;        // (n) of this rank
  std::vector<std::int32_t> fixed;  // (n) 0 free, otherwise 1 + the first entry of ReadOptions::fixed that names the node
  comm::IndexPartition elements;
  std::vector<std::int32_t> tets;  // (e, 4) or (e, 10) numbers of nodes
  std::vector<std::int32_t> regions;
  std::vector<Vec3> centres_m;  // (e)

  std::size_t width() const { return order == 1 ? 4 : 10; }
  std::int64_t node_count() const { return corners.total() + mids.total(); }
  std::int64_t own_node_count() const { return corners.own_count() + mids.own_count(); }
  int find_owner(std::int64_t node) const {
    return node < corners.total() ? corners.find_owner(node) : mids.find_owner(node - corners.total());
  }
  /// Index in nodes_m of a node of this rank.
  std::size_t to_local(std::int64_t node) const {
    if (node < corners.total()) return corners.to_local(node);
    return static_cast<std::size_t>(corners.own_count()) + mids.to_local(node - corners.total());
  }
};

}  // namespace carillon::mesh

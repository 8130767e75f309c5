// One rank's block of a mesh that no rank has whole: a run of the elements and a run of the nodes.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/comm/index_partition.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesh {

/// A run of nodes and a run of elements, nowhere near each other in general. Nodes are numbered over the whole mesh: the corners of the
/// file first, then mid nodes that were added; each kind is in one run per rank. nodes_m and fixed have this rank's corners, then its mids.
struct MeshBlock {
  int order = 1;
  comm::IndexPartition corners;     // who has the nodes of the file that are in use
  comm::IndexPartition mids;        // and those that were added, numbered from corners.total()
  std::vector<Vec3> nodes_m;        // (n) this rank's
  std::vector<std::int32_t> fixed;  // (n) 0 free, else 1 + the first entry of ReadOptions::fixed that names the node
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
  /// Where a node that this rank has is in nodes_m.
  std::size_t to_local(std::int64_t node) const {
    if (node < corners.total()) return corners.to_local(node);
    return static_cast<std::size_t>(corners.own_count()) + mids.to_local(node - corners.total());
  }
};

}  // namespace carillon::mesh

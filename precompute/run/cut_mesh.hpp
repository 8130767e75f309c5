// A mesh cut into pieces where its factorisation will have its separators.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "partition/dissect.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/comm/communicator.hpp"
#include "precompute/ldlt/mesh_order.hpp"
#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesh/parallel/read_parallel.hpp"

namespace carillon::run {

struct CutMesh {
  mesh::DistributedMesh pieces;
  std::shared_ptr<const ldlt::MeshOrder> order;  // of the factorisation, by which the mesh is cut; null: METIS cuts, it orders by itself
};

/// Cuts the mesh by METIS or, on several ranks with at least 300 nodes each on average, by the order of elimination: each element goes to
/// the rank that eliminates the first of its nodes, or where that rank would have too many to one that would have too few, so that all
/// have nearly the same number. Above `largest_ordered` nodes METIS cuts first, so that all ranks can order. Collective. Throws as
/// mesh::distribute().
CutMesh cut_by_order(const comm::Communicator& comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes,
                     std::int32_t largest_ordered = partition::kLargestGathered);

/// A cut by the order for read_parallel, after its own cut.
class RecutByOrder {
 public:
  explicit RecutByOrder(const comm::Communicator& comm);
  /// For ReadOptions; this must outlive the reading.
  parallel_mesh::Recut make_recut();
  /// What the reading has made, and the mesh is cut by; null: the mesh was too small.
  std::shared_ptr<const ldlt::MeshOrder> get_order() const { return order_; }

 private:
  const comm::Communicator comm_;
  std::shared_ptr<ldlt::MeshOrder> order_;
};

}  // namespace carillon::run

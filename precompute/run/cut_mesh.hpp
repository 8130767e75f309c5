// Mesh partition along the separators of the factorisation.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "partition/dissect.hpp"
#include "precompute/comm/communicator.hpp"
#include "precompute/ldlt/mesh_order.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/mesh/parallel/read_parallel.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::run {

struct CutMesh {
  mesh::DistributedMesh pieces;
  std::shared_ptr<const ldlt::MeshOrder>
      order;  // of the factorisation, defines the cut; null: METIS cut, the factorisation orders by itself
};

/// Cuts the mesh by METIS or, on several ranks with at least 300 nodes each on average, by the elimination order: each element goes to the
/// rank that eliminates its first node, then counts are levelled so that ranks have nearly equal numbers. Above `largest_ordered` nodes
/// METIS cuts first, so that all ranks can order. Collective. Throws as mesh::distribute().
CutMesh cut_by_order(const comm::Communicator& comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes,
                     std::int32_t largest_ordered = partition::kLargestGathered);

/// Second cut by the elimination order, for read_parallel.
class RecutByOrder {
 public:
  explicit RecutByOrder(const comm::Communicator& comm);
  /// For ReadOptions; this must outlive the reading.
  parallel_mesh::Recut make_recut();
  /// Order of the cut mesh; null: the mesh was too small.
  std::shared_ptr<const ldlt::MeshOrder> get_order() const { return order_; }

 private:
  const comm::Communicator comm_;
  std::shared_ptr<ldlt::MeshOrder> order_;
};

}  // namespace carillon::run

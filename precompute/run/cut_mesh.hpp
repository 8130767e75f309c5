// A mesh cut into pieces where its factorisation will have its separators.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "partition/distribute.hpp"
#include "precompute/comm/communicator.hpp"
#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/parallel_mesh/read_parallel.hpp"

namespace carillon::ldlt {
class MeshOrder;
}  // namespace carillon::ldlt

namespace carillon::run {

struct CutMesh {
  partition::DistributedMesh pieces;
  std::shared_ptr<const ldlt::MeshOrder> order;  // for the factorisation; null: it orders by itself
};

/// Whether a mesh of so many free nodes is cut by its separator tree: on several ranks, with enough nodes on each.
bool is_cut_by_order(const comm::Communicator& comm, std::int64_t free_nodes);

/// Orders the nodes of the mesh on rank 0, and sends each element to the rank that eliminates the first of its nodes. Where that would
/// leave a rank with too little, METIS cuts the mesh. Collective. Throws as partition::distribute().
CutMesh cut_by_order(const comm::Communicator& comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes);

/// Has read_parallel cut the mesh by its separator tree too, which `order` gets. `order` must outlive the reading.
void cut_by_order(const comm::Communicator& comm, parallel_mesh::ReadOptions& options, std::shared_ptr<const ldlt::MeshOrder>& order);

}  // namespace carillon::run

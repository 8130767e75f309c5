// Distribution of a mesh from rank 0: each rank gets its tetrahedra and their nodes.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

struct DistributeOptions {
  std::vector<std::int32_t> part = {};  // rank 0: (E) rank of each element; empty: METIS
  bool elimination_order = false;       // order the whole graph on rank 0, for factorisations that cannot order a distributed matrix
};

/// Nodes that are used by elements and not fixed, ascending. Throws InputError if a fixed node is not in the mesh, or all nodes are fixed.
std::vector<std::int32_t> list_free_nodes(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes);

/// Cuts the mesh, numbers the free nodes contiguously per rank, and sends each rank its part. The mesh and the fixed nodes are read on rank
/// 0 only; the mesh is not needed afterwards. Collective. Throws on every rank: InputError if there are fewer tetrahedra than ranks, a
/// fixed node is not in the mesh, or all nodes are fixed; SystemError if memory runs out.
DistributedMesh distribute(const comm::Communicator& comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes,
                           const DistributeOptions& options = {});

}  // namespace carillon::mesh

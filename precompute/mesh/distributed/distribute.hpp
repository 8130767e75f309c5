// From a mesh on rank 0 to a distributed one: each rank gets its own tetrahedra and the nodes they touch.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

struct DistributeOptions {
  std::vector<std::int32_t> part = {};  // rank 0: (E) the rank of each element; empty: METIS cuts
  bool elimination_order = false;  // order the whole graph on rank 0, for factorisations that cannot order a distributed matrix themselves
};

/// The nodes that elements use and that are not fixed, ascending. Throws InputError when a fixed node is not in the mesh, or every node is
/// fixed.
std::vector<std::int32_t> list_free_nodes(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes);

/// Cuts the mesh, numbers the free nodes so that each rank's are contiguous, and sends each rank its part. The mesh and the
/// fixed nodes are read on rank 0 only; afterwards the mesh is not needed any more.
/// Collective. Throws on every rank: InputError when there are fewer tetrahedra than ranks, a fixed node is not in the mesh, or every node
/// is fixed; SystemError when memory runs out.
DistributedMesh distribute(const comm::Communicator& comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes,
                           const DistributeOptions& options = {});

}  // namespace carillon::mesh

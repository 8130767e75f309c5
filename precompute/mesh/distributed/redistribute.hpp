// From blocks in the order of a file to a distributed mesh: elements to their ranks, owners and rows of nodes, components.
#pragma once

#include <string>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/mesh/distributed/mesh_block.hpp"

namespace carillon::mesh {

/// Moves every element to the rank that `part` (e) names and numbers the nodes; the block is empty afterwards, but for its IndexPartitions.
/// Fills all of DistributedMesh but the report's cut, and `on_seam` (n): which local nodes other ranks touch too. has_fixed: whether any
/// node may be fixed, the same on every rank. `name` begins messages.
/// Collective. Throws on every rank: InputError when no node is free, SystemError when memory runs out.
DistributedMesh redistribute(const comm::Communicator& comm, const std::string& name, MeshBlock& block,
                             const std::vector<std::int32_t>& part, bool has_fixed, std::vector<char>& on_seam);

}  // namespace carillon::mesh

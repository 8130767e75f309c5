// From blocks in file order to a distributed mesh: moves elements, assigns node owners and rows, finds components.
#pragma once

#include <string>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/mesh/distributed/mesh_block.hpp"

namespace carillon::mesh {

/// Moves every element to rank `part` (e) and numbers the nodes; the block is empty afterwards, except for its IndexPartitions. Fills
/// DistributedMesh except the cut in the report, and `on_seam` (n): local nodes also touched by other ranks. has_fixed: true if any node
/// may be fixed, the same on every rank. `name` starts messages. Collective. Throws on every rank: InputError if no node is free,
/// SystemError if memory runs out.
DistributedMesh redistribute(const comm::Communicator& comm, const std::string& name, MeshBlock& block,
                             const std::vector<std::int32_t>& part, bool has_fixed, std::vector<char>& on_seam);

}  // namespace carillon::mesh

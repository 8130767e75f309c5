// Boundary of a distributed mesh and checks of its faces. Internal header of the parallel reader.
#pragma once

#include <string>
#include <vector>

#include "precompute/comm/index_partition.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/parallel/read_parallel.hpp"

namespace carillon::parallel_mesh {

/// Matches the faces of all elements: refuses duplicate elements, faces of more than two elements and elements on one side of a common
/// face; counts the cut; returns the boundary on rank 0. corners: rank that matches the faces of each lowest corner; on_seam (n): local
/// nodes shared with other ranks. Collective. Throws InputError on every rank.
Boundary find_boundary(const comm::Communicator& comm, const std::string& name, const comm::IndexPartition& corners,
                       const std::vector<char>& on_seam, mesh::DistributedMesh& mesh, mesh::CheckReport& report);

}  // namespace carillon::parallel_mesh

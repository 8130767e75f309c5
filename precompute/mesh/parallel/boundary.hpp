// The boundary of a distributed mesh, and how its elements meet. Inner header of the parallel reader.
#pragma once

#include <string>
#include <vector>

#include "precompute/comm/index_partition.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/parallel/read_parallel.hpp"

namespace carillon::parallel_mesh {

/// Brings the faces of all elements together: refuses elements given twice, faces of more than two elements and elements on one side of
/// their common face; counts the cut; returns the boundary on rank 0. corners: who brings together the faces whose lowest corner is which
/// node; on_seam (n): which local nodes other ranks touch too. Collective. Throws InputError on every rank.
Boundary find_boundary(const comm::Communicator& comm, const std::string& name, const comm::IndexPartition& corners,
                       const std::vector<char>& on_seam, mesh::DistributedMesh& mesh, mesh::CheckReport& report);

}  // namespace carillon::parallel_mesh

// One rank's block of the file, read and checked, and its fixed nodes. Internal header of the parallel reader.
#pragma once

#include <filesystem>
#include <string>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/distributed/mesh_block.hpp"
#include "precompute/mesh/parallel/layout.hpp"
#include "precompute/mesh/parallel/read_parallel.hpp"
#include "precompute/mesh/parallel/source.hpp"

namespace carillon::parallel_mesh {

/// Marks the nodes of all named sets in block.fixed. Collective. Throws InputError on every rank for an unknown or empty set.
void read_fixed_sets(const comm::Communicator& comm, const Source& source, const std::string& name, const Layout& layout,
                     const ReadOptions& options, mesh::MeshBlock& block);

/// Computes the mesh box for the report and marks the nodes of the given boxes. Collective. Throws InputError on every rank for a box
/// without a node.
void find_fixed_boxes(const comm::Communicator& comm, const std::string& name, const ReadOptions& options, mesh::MeshBlock& block,
                      mesh::CheckReport& report);

/// Reads this rank's block, checks and reorients its elements, drops unused nodes and converts elements to the requested order; counts
/// repairs in `report`. `name` begins every message. Collective. Throws as read_parallel().
mesh::MeshBlock read_block(const comm::Communicator& comm, const std::filesystem::path& file, const std::string& name, const Layout& layout,
                           const ReadOptions& options, mesh::CheckReport& report);

}  // namespace carillon::parallel_mesh

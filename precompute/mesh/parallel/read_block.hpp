// One rank's block of the file, read and checked. Internal header of the parallel reader.
#pragma once

#include <filesystem>
#include <string>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/distributed/mesh_block.hpp"
#include "precompute/mesh/parallel/layout.hpp"
#include "precompute/mesh/parallel/read_parallel.hpp"

namespace carillon::parallel_mesh {

/// Reads this rank's block, checks and reorients its elements, drops unused nodes and converts elements to the requested order; counts
/// repairs in `report`. `name` begins every message. Collective. Throws as read_parallel().
mesh::MeshBlock read_block(const comm::Communicator& comm, const std::filesystem::path& file, const std::string& name, const Layout& layout,
                           const ReadOptions& options, mesh::CheckReport& report);

}  // namespace carillon::parallel_mesh

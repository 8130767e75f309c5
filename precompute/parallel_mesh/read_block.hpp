// One rank's block of the file, read and checked. Inner header of the parallel reader.
#pragma once

#include <filesystem>
#include <string>

#include "partition/mesh_block.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/parallel_mesh/layout.hpp"
#include "precompute/parallel_mesh/read_parallel.hpp"

namespace carillon::parallel_mesh {

/// Reads this rank's block, checks and turns its elements, drops unused nodes and brings the elements to the order asked for; counts what
/// was done in `report`. `name` begins every message. Collective. Throws as read_parallel().
partition::MeshBlock read_block(const comm::Communicator& comm, const std::filesystem::path& file, const std::string& name,
                                const Layout& layout, const ReadOptions& options, mesh::CheckReport& report);

}  // namespace carillon::parallel_mesh

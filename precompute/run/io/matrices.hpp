// K and M of a job as files that other programs read.
#pragma once

#include <filesystem>

#include "precompute/fem/assemble.hpp"

namespace carillon::io {

/// Makes the folder and checks that the files can be written there, before the work; an empty path: does nothing. Collective. Throws
/// InputError on every rank.
void check_matrices(const comm::Communicator& comm, const std::filesystem::path& folder);

/// Writes K and M as the solver gets them to the folder: stiffness.mtx [N/m] and mass.mtx [kg] (Matrix Market, coordinate,
/// real, symmetric, 17 digits), and nodes.csv with the free nodes, one a line: its number in the mesh and where it is [m]. Row 3 i + d + 1
/// of a matrix is direction d of line i, counted from 0. Lines follow the numbers in the mesh, so that the ranks have no say in them. Every
/// file appears whole or not at all. Collective. Throws on every rank: SystemError when the disk refuses.
void write_matrices(const comm::Communicator& comm, const std::filesystem::path& folder, const mesh::LocalMesh& local,
                    const fem::System& system);

}  // namespace carillon::io

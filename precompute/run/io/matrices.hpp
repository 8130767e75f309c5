// Export of K and M for other programs.
#pragma once

#include <filesystem>

#include "precompute/fem/assemble.hpp"

namespace carillon::io {

/// Makes the folder and checks that the files can be written, before the work; an empty path does nothing. Collective. Throws InputError on
/// every rank.
void check_matrices(const comm::Communicator& comm, const std::filesystem::path& folder);

/// Writes K and M as the solver uses them: stiffness.mtx [N/m] and mass.mtx [kg] (Matrix Market, coordinate, real, symmetric, 17 digits),
/// and nodes.csv with the free nodes, one per line: number in the mesh and position [m]. Row 3 i + d + 1 of a matrix is direction d of line
/// i, counted from 0. Lines are in mesh order, independent of the ranks. Files are written atomically. Collective. Throws on every rank:
/// SystemError when a write fails.
void write_matrices(const comm::Communicator& comm, const std::filesystem::path& folder, const mesh::LocalMesh& local,
                    const fem::System& system);

}  // namespace carillon::io

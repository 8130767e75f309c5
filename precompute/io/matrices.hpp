// K and M of a job as files that other programs read.
#pragma once

#include "precompute/fem/assemble.hpp"
#include "precompute/io/body.hpp"
#include "precompute/io/run.hpp"

namespace carillon::io {

/// Makes the folder of RunOptions::matrices, if one is asked for. Collective. Throws InputError on every rank when files cannot be written
/// there: meant for before the work.
void check_matrices(const Run& run);

/// Writes K and M as the solver gets them, if a folder is asked for: stiffness.mtx [N/m] and mass.mtx [kg] (Matrix Market, coordinate,
/// real, symmetric, 17 digits), and nodes.csv with the free nodes, one a line: its number in the mesh and where it is [m]. Row 3 i + d + 1
/// of a matrix is direction d of line i, counted from 0. Lines follow the numbers in the mesh, so that the ranks have no say in them. Every
/// file appears whole or not at all. Collective. Throws on every rank: SystemError when the disk refuses.
void write_matrices(Run& run, const Body& body, const fem::System& system);

}  // namespace carillon::io

// Mode shapes from all ranks to rank 0, at the nodes that a bank keeps.
#pragma once

#include <mpi.h>
#include <petscmat.h>

#include <cstdint>
#include <vector>

namespace carillon::io {

/// Gathers the columns of `shapes` at the nodes of `row` on rank 0: (V, m, 3), zero where the row is -1 (held); empty on the other ranks.
/// row: (V), rank 0 only; r stands for the rows 3 r, 3 r + 1, 3 r + 2 of shapes, a dense (3n, m) matrix, or null when there are no modes.
/// Collective.
std::vector<double> gather_shapes(MPI_Comm comm, Mat shapes, const std::vector<std::int32_t>& row);

}  // namespace carillon::io

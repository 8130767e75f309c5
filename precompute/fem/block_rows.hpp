// The sparsity of K and M by nodes, and the arrays of both matrices.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/comm/communicator.hpp"
#include "precompute/fem/element.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::fem {

/// Rows of 3 x 3 blocks, one row a node. Blocks of a row are stored as PETSc needs them: its three scalar rows one after the other, each
/// with three entries a column.
struct BlockRows {
  std::vector<std::int64_t> begin{0};  // (rows + 1) place of each row's first column
  std::vector<std::int32_t> column;    // ascending in each row
  std::vector<double> stiffness;       // 9 a column
  std::vector<double> mass;            // 1 a column; empty when lumped

  std::int64_t row_count() const { return static_cast<std::int64_t>(begin.size()) - 1; }
  /// Adds the 3 x 3 block k, whose rows are `stride` apart, and the mass m to column c of the row. Pre: the column is there.
  void add(std::int64_t row, std::int32_t c, const double* k, int stride, double m);
};

/// The rows that one rank's elements touch while they are summed up.
struct LocalRows {
  std::vector<std::int32_t> first_row;  // (ranks + 1) node rows of all ranks
  std::int32_t first_own = 0;           // first_row of this rank
  BlockRows own;   // own rows, own columns counted from first_own; the upper triangle is summed, finish() does the lower
  BlockRows off;   // own rows, columns of other ranks by global number
  BlockRows halo;  // rows of other ranks, columns by global number
  std::vector<std::int32_t> halo_row;  // (halo rows) global number, ascending
  std::vector<std::int32_t> slot;      // (local nodes) own row, or -2 - halo row, or -1: fixed
  bool is_lumped = false;
  std::vector<double> lumped;          // (own rows), then (halo rows), when lumped
  std::vector<std::int32_t> arriving;  // what other ranks send of own rows: row, number of columns, columns, by rank

  /// Adds the matrices of an element whose nodes are the local `nodes`.
  void add(std::span<const std::int32_t> nodes, const mesh::LocalMesh& local, const ElementMatrices& element);
};

/// The pattern of the elements of all ranks, values zero. Collective. Throws SystemError on every rank when a rank's share is beyond 32-bit
/// indices or memory.
LocalRows make_rows(const comm::Communicator& comm, const mesh::LocalMesh& local, bool lumped);

/// Sends what was summed for other ranks' rows to them, adds what they send, and completes the lower triangle. Collective.
void finish(const comm::Communicator& comm, LocalRows& rows);

/// Hands the stiffness over to a PETSc matrix, then the mass; each takes its part of the arrays out of `rows`. Collective.
petsc::MatHandle take_stiffness(const comm::Communicator& comm, LocalRows& rows);
petsc::MatHandle take_mass(const comm::Communicator& comm, LocalRows& rows);

}  // namespace carillon::fem

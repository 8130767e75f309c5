// Sparsity of K and M by nodes, and the arrays of both matrices.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/fem/element.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::fem {

/// Rows of 3 x 3 blocks, one per node, in PETSc's order: the three scalar rows one after the other, each with three entries per column.
struct BlockRows {
  std::vector<std::int64_t> begin{0};  // (rows + 1) offset of each row's first column
  std::vector<std::int32_t> column;    // ascending in each row
  std::vector<double> stiffness;       // 9 per column
  std::vector<double> mass;            // 1 per column; empty when lumped

  std::int64_t row_count() const { return static_cast<std::int64_t>(begin.size()) - 1; }
  /// Adds the 3 x 3 block k (row stride `stride`) and the mass m to column c of the row. Pre: the column exists.
  void add(std::int64_t row, std::int32_t c, const double* k, int stride, double m);
};

/// Rows touched by one rank's elements during assembly.
struct LocalRows {
  std::vector<std::int32_t> first_row;  // (ranks + 1) node rows of all ranks
  std::int32_t first_own = 0;           // first_row of this rank
  BlockRows own;   // own rows, own columns counted from first_own; assembly fills the upper triangle, finish() the lower
  BlockRows off;   // own rows, columns of other ranks by global number
  BlockRows halo;  // rows of other ranks, columns by global number
  std::vector<std::int32_t> halo_row;  // (halo rows) global number, ascending
  std::vector<std::int32_t> slot;      // (local nodes) own row, or -2 - halo row, or -1: fixed
  bool is_lumped = false;
  std::vector<double> lumped;          // (own rows), then (halo rows), when lumped
  std::vector<std::int32_t> arriving;  // own rows sent by other ranks: row, number of columns, columns, by rank

  /// Adds the matrices of an element with the local nodes `nodes`.
  void add(std::span<const std::int32_t> nodes, const mesh::LocalMesh& local, const ElementMatrices& element);
};

/// Pattern of the elements of all ranks, values zero. Collective. Throws SystemError on every rank if one rank's share exceeds 32-bit
/// indices or memory.
LocalRows make_rows(const comm::Communicator& comm, const mesh::LocalMesh& local, bool lumped);

/// Exchanges the sums of shared rows and completes the lower triangle. Collective.
void finish(const comm::Communicator& comm, LocalRows& rows);

/// Moves the stiffness into a PETSc matrix, then the mass; each takes its part of the arrays from `rows`. Collective.
petsc::MatHandle take_stiffness(const comm::Communicator& comm, LocalRows& rows);
petsc::MatHandle take_mass(const comm::Communicator& comm, LocalRows& rows);

}  // namespace carillon::fem

// Symmetric pencils with known answers: small lattices of springs and random matrices, with a chosen distribution.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

#include "precompute/petsc/handle.hpp"

namespace carillon::ldlt::test {

/// K and M twice: dense on every rank, and as distributed PETSc matrices.
struct Pencil {
  Eigen::MatrixXd dense_k;
  Eigen::MatrixXd dense_m;
  petsc::MatHandle k;
  petsc::MatHandle m;
  PetscInt first_row = 0;
  PetscInt rows = 0;
};

enum class MassKind { kDiagonal, kConsistent };

/// `copies` unconnected elastic lattices of nx x ny x nz nodes: springs of random rate along the axes and all diagonals of the cells,
/// unsupported, so that each copy has six rigid motions. Random masses.
Pencil make_lattice(int nx, int ny, int nz, int copies, MassKind kind, std::uint64_t seed);

/// Random 3x3 blocks, indefinite: `nodes` nodes with about `degree` neighbours each; M is positive definite.
Pencil make_random(int nodes, int degree, std::uint64_t seed);

/// Distributes dense matrices (zeros are stored only within nonzero 3x3 blocks). nodes_of_rank: nodes of each rank; empty: evenly.
void distribute(Pencil& pencil, const std::vector<int>& nodes_of_rank = {});

}  // namespace carillon::ldlt::test

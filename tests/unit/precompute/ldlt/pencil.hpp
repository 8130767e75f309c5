// Symmetric pencils with known answers: small lattices of springs and random matrices, distributed as a test likes.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

#include "precompute/petsc/handle.hpp"

namespace carillon::ldlt::test {

/// K and M twice: dense on every rank, and as PETSc matrices whose rows are spread over the ranks.
struct Pencil {
  Eigen::MatrixXd dense_k;
  Eigen::MatrixXd dense_m;
  petsc::MatHandle k;
  petsc::MatHandle m;
  PetscInt first_row = 0;
  PetscInt rows = 0;
};

enum class MassKind { kDiagonal, kConsistent };

/// An elastic lattice of nx x ny x nz nodes, `copies` of them without a connection: springs of random rate along the axes and all
/// diagonals of the cells, free in space, so that each copy has six rigid motions. Random masses.
Pencil make_lattice(int nx, int ny, int nz, int copies, MassKind kind, std::uint64_t seed);

/// Random 3x3 blocks, indefinite: `nodes` nodes with about `degree` neighbours each; M is positive definite.
Pencil make_random(int nodes, int degree, std::uint64_t seed);

/// Distributes dense matrices (zeros are not stored, but for those of 3x3 blocks that hold anything). nodes_of_rank: how many nodes each
/// rank gets; empty: evenly.
void distribute(Pencil& pencil, const std::vector<int>& nodes_of_rank = {});

}  // namespace carillon::ldlt::test

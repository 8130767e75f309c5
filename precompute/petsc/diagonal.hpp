// Diagonal of a distributed matrix as plain numbers.
#pragma once

#include <petscmat.h>

#include <vector>

namespace carillon::petsc {

/// (own rows), in the unit of the matrix, which is square, assembled and has equal row and column distributions. Collective. Throws as
/// check() does, SystemError on every rank if one has no memory for the copy.
std::vector<double> read_diagonal(Mat matrix);

}  // namespace carillon::petsc

// Lowest modes of K and M on one rank by Eigen alone: subspace iteration with (K + shift M)^-1 M and Rayleigh-Ritz.
#pragma once

#include <petscmat.h>

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <vector>

#include "precompute/petsc/session.hpp"

namespace carillon::tests {

using SparseMatrix = Eigen::SparseMatrix<double>;

/// Rows and columns of one rank's matrix with non-negative `number`.
inline SparseMatrix reduce(const Mat matrix, const std::vector<int>& number, int size) {
  std::vector<Eigen::Triplet<double>> entries;
  for (PetscInt row = 0; row < static_cast<PetscInt>(number.size()); ++row) {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const double* values = nullptr;
    petsc::check(MatGetRow(matrix, row, &count, &columns, &values));
    for (PetscInt i = 0; i < count; ++i)
      if (number[row] >= 0 && number[columns[i]] >= 0) entries.emplace_back(number[row], number[columns[i]], values[i]);
    petsc::check(MatRestoreRow(matrix, row, &count, &columns, &values));
  }
  SparseMatrix reduced(size, size);
  reduced.setFromTriplets(entries.begin(), entries.end());
  return reduced;
}

inline SparseMatrix copy(const Mat matrix) {
  PetscInt rows = 0;
  petsc::check(MatGetSize(matrix, &rows, nullptr));
  std::vector<int> number(rows);
  for (PetscInt i = 0; i < rows; ++i) number[i] = i;
  return reduce(matrix, number, rows);
}

struct Eigenpairs {
  Eigen::VectorXd lambda;
  Eigen::MatrixXd shapes;
};

/// The `wanted` lowest eigenpairs of K x = lambda M x, ascending; `shift` > 0 for a singular K.
inline Eigenpairs iterate_subspace(const SparseMatrix& k, const SparseMatrix& m, int wanted, double shift = 0, int passes = 25) {
  const SparseMatrix shifted = k + shift * m;
  const Eigen::SimplicialLLT<SparseMatrix> factor(shifted);
  Eigen::MatrixXd basis = Eigen::MatrixXd::Random(k.rows(), wanted + 10);
  Eigen::VectorXd lambda;
  for (int pass = 0; pass < passes; ++pass) {
    basis = factor.solve(m * basis).eval();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz(basis.transpose() * (k * basis), basis.transpose() * (m * basis));
    basis = (basis * ritz.eigenvectors()).eval();
    lambda = ritz.eigenvalues();
  }
  return {lambda.head(wanted), basis.leftCols(wanted)};
}

}  // namespace carillon::tests

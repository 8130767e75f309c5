// Decompositions of small dense matrices by Eigen, compiled once here because each instantiation takes seconds.
#pragma once

#include "precompute/la/lapack.hpp"

namespace carillon::la {

/// A = Q R by Householder reflections. A: (m, n).
struct Qr {
  Matrix q;  // (m, q_columns), orthonormal; columns beyond n: of the complement of the columns of A
  Matrix r;  // (min(m, n), n), upper triangular
};
Qr calc_qr(const Matrix& a, Eigen::Index q_columns);

/// Orthonormal basis of the column space of A, (m, rank), by pivoted QR. Diagonal entries of R up to `tolerance` count as zero.
Matrix calc_column_space(const Matrix& a, double tolerance);

/// A = U diag(values) V^T by Jacobi rotations. A: (m, n).
struct Svd {
  Vector values;  // (min(m, n)), descending
  Matrix v;       // (n, n)
};
Svd calc_svd(const Matrix& a);

/// A^-1, A: (n, n), by LU with partial pivoting.
Matrix calc_inverse(const Matrix& a);

}  // namespace carillon::la

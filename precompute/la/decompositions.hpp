// Decompositions of small dense matrices by Eigen. Compiled here once: they cost seconds in every source that instantiates them.
#pragma once

#include "precompute/la/lapack.hpp"

namespace carillon::la {

/// A = Q R by reflections. A: (m, n).
struct Qr {
  Matrix q;  // (m, columns asked for), orthonormal; beyond n: of the complement of A's columns
  Matrix r;  // (min(m, n), n), upper triangular
};
Qr calc_qr(const Matrix& a, Eigen::Index q_columns);

/// Orthonormal basis of the space of A's columns, (m, rank), by QR with pivots. Diagonal entries of R up to `tolerance` count as zero.
Matrix calc_column_space(const Matrix& a, double tolerance);

/// A = U diag(values) V^T by Jacobi's rotations. A: (m, n).
struct Svd {
  Vector values;  // (min(m, n)), descending
  Matrix v;       // (n, n)
};
Svd calc_svd(const Matrix& a);

/// A^-1, A: (n, n), by LU with partial pivots.
Matrix calc_inverse(const Matrix& a);

}  // namespace carillon::la

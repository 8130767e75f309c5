// BLAS and LAPACK for small dense matrices; prototypes are in lapack.cpp. petsc/blas.cpp has one more prototype of dgemm, looked up at run
// time to make BLAS allocate its memory at the start, because it must not include this folder.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

namespace carillon::la {

/// Column-major, as in BLAS and LAPACK.
using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// All entries, column by column.
template <typename Derived>
std::span<double> entries(Eigen::PlainObjectBase<Derived>& values) {
  return {values.data(), static_cast<std::size_t>(values.size())};
}

enum class Transpose { kNo, kYes };

/// C <- alpha op(A) B + beta C, op(A): (m, k), B: (k, n), C: (m, n), each with its leading dimension. No operation if m or n is 0.
void gemm(Transpose a_transposed, std::ptrdiff_t m, int n, std::ptrdiff_t k, double alpha, const double* a, std::ptrdiff_t lda,
          const double* b, std::ptrdiff_t ldb, double beta, double* c, std::ptrdiff_t ldc);

/// B <- B R^-1 (dtrsm), B: (rows, n), R: (n, n) upper triangular.
void solve_upper_from_right(std::ptrdiff_t rows, int n, const double* r, std::ptrdiff_t ldr, double* b, std::ptrdiff_t ldb);

/// Return values: info of the LAPACK routine, 0 on success.
/// A = R^T R; R replaces the upper triangle of A, the lower one is unchanged (dpotrf).
int factorise_cholesky(Matrix& a);
/// Inverts the upper triangle of R in place, the lower one is unchanged (dtrtri).
int invert_upper(Matrix& r);
/// Eigenpairs of a symmetric A given by its lower triangle; eigenvectors replace A; values: (n), ascending. By QR (dsyev).
int calc_eigenpairs(Matrix& a, Vector& values);
/// The same by divide and conquer (dsyevd): faster from some hundred rows on, different rounding. By QR where it does not converge, as of
/// one finite matrix of 194 rows with OpenBLAS 0.3.21.
int calc_eigenpairs_by_division(Matrix& a, Vector& values);
/// A x = lambda B x, both symmetric, B positive definite, lower triangles; B-orthonormal eigenvectors replace A, B is destroyed; values:
/// (n), ascending. By QR (dsygv).
int calc_generalised_eigenpairs(Matrix& a, Matrix& b, Vector& values);
/// The same by divide and conquer (dsygvd), by QR where it does not converge.
int calc_generalised_eigenpairs_by_division(Matrix& a, Matrix& b, Vector& values);

}  // namespace carillon::la

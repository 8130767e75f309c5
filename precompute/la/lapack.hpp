// BLAS and LAPACK for small dense matrices: lapack.cpp has their prototypes. One more, of dgemm, is in petsc/blas.cpp, which looks it up at
// run time to make BLAS allocate its memory at the start, and may not include this folder.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

namespace carillon::la {

/// Column-major, as BLAS and LAPACK have it.
using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// All entries, by column.
template <typename Derived>
std::span<double> entries(Eigen::PlainObjectBase<Derived>& values) {
  return {values.data(), static_cast<std::size_t>(values.size())};
}

enum class Transpose { kNo, kYes };

/// C <- alpha op(A) B + beta C, op(A): (m, k), B: (k, n), C: (m, n), each with the distance of its columns. Nothing is done where m or n
/// is 0.
void gemm(Transpose a_transposed, std::ptrdiff_t m, int n, std::ptrdiff_t k, double alpha, const double* a, std::ptrdiff_t lda,
          const double* b, std::ptrdiff_t ldb, double beta, double* c, std::ptrdiff_t ldc);

/// B <- B R^-1 (dtrsm), B: (rows, n), R: (n, n), its upper triangle.
void solve_upper_from_right(std::ptrdiff_t rows, int n, const double* r, std::ptrdiff_t ldr, double* b, std::ptrdiff_t ldb);

/// LAPACK's return values: 0, or what dpotrf, dtrtri, dsyev, dsyevd, dsygv or dsygvd call info.
/// A = R^T R; R takes the upper triangle of A, the lower one stays (dpotrf).
int factorise_cholesky(Matrix& a);
/// The upper triangle of R becomes that of its inverse, the lower one stays (dtrtri).
int invert_upper(Matrix& r);
/// The eigenvectors of a symmetric A, of which the lower triangle is read, take its place; values: (n), ascending. By QR (dsyev).
int calc_eigenpairs(Matrix& a, Vector& values);
/// The same by divide and conquer (dsyevd): faster for some hundred rows, other rounding.
int calc_eigenpairs_by_division(Matrix& a, Vector& values);
/// A x = lambda B x, both symmetric, B positive definite, lower triangles; eigenvectors, B-orthonormal, take the place of A, B is
/// destroyed; values: (n), ascending. By QR (dsygv).
int calc_generalised_eigenpairs(Matrix& a, Matrix& b, Vector& values);
/// The same by divide and conquer (dsygvd).
int calc_generalised_eigenpairs_by_division(Matrix& a, Matrix& b, Vector& values);

}  // namespace carillon::la

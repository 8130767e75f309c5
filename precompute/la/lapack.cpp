// Sizes of work arrays determine the blocking of LAPACK, and with it the rounding: they affect results.
#include "precompute/la/lapack.hpp"

#include <algorithm>
#include <vector>

extern "C" {
void dgemm_(const char* a_transposed, const char* b_transposed, const int* m, const int* n, const int* k, const double* alpha,
            const double* a, const int* lda, const double* b, const int* ldb, const double* beta, double* c, const int* ldc);
void dtrsm_(const char* side, const char* half, const char* transposed, const char* diagonal, const int* m, const int* n,
            const double* alpha, const double* a, const int* lda, double* b, const int* ldb);
void dpotrf_(const char* half, const int* n, double* a, const int* lda, int* info);
void dtrtri_(const char* half, const char* diagonal, const int* n, double* a, const int* lda, int* info);
void dsyev_(const char* job, const char* half, const int* n, double* a, const int* lda, double* w, double* work, const int* work_size,
            int* info);
void dsyevd_(const char* job, const char* half, const int* n, double* a, const int* lda, double* w, double* work, const int* work_size,
             int* integers, const int* integers_size, int* info);
void dsygv_(const int* type, const char* job, const char* half, const int* n, double* a, const int* lda, double* b, const int* ldb,
            double* w, double* work, const int* work_size, int* info);
void dsygvd_(const int* type, const char* job, const char* half, const int* n, double* a, const int* lda, double* b, const int* ldb,
             double* w, double* work, const int* work_size, int* integers, const int* integers_size, int* info);
}

namespace carillon::la {
namespace {

int to_stride(std::ptrdiff_t columns_apart) { return static_cast<int>(std::max<std::ptrdiff_t>(columns_apart, 1)); }

/// Of dsyev and dsygv: tridiagonal reduction in blocks of up to 64 columns.
int calc_work_size(int n) { return 64 * n + 3 * n; }

}  // namespace

void gemm(Transpose a_transposed, std::ptrdiff_t m, int n, std::ptrdiff_t k, double alpha, const double* a, std::ptrdiff_t lda,
          const double* b, std::ptrdiff_t ldb, double beta, double* c, std::ptrdiff_t ldc) {
  if (m == 0 || n == 0) return;
  const int rows = static_cast<int>(m), depth = static_cast<int>(k), a_stride = to_stride(lda), b_stride = to_stride(ldb);
  const int c_stride = to_stride(ldc);
  dgemm_(a_transposed == Transpose::kYes ? "T" : "N", "N", &rows, &n, &depth, &alpha, a, &a_stride, b, &b_stride, &beta, c, &c_stride);
}

void solve_upper_from_right(std::ptrdiff_t rows, int n, const double* r, std::ptrdiff_t ldr, double* b, std::ptrdiff_t ldb) {
  if (rows == 0 || n == 0) return;
  const int m = static_cast<int>(rows), r_stride = to_stride(ldr), b_stride = to_stride(ldb);
  const double one = 1;
  dtrsm_("R", "U", "N", "N", &m, &n, &one, r, &r_stride, b, &b_stride);
}

int factorise_cholesky(Matrix& a) {
  const int n = static_cast<int>(a.rows());
  int info = 0;
  dpotrf_("U", &n, a.data(), &n, &info);
  return info;
}

int invert_upper(Matrix& r) {
  const int n = static_cast<int>(r.rows());
  int info = 0;
  dtrtri_("U", "N", &n, r.data(), &n, &info);
  return info;
}

int calc_eigenpairs(Matrix& a, Vector& values) {
  const int n = static_cast<int>(a.rows()), work_size = calc_work_size(n);
  int info = 0;
  values.resize(n);
  std::vector<double> work(work_size);
  dsyev_("V", "L", &n, a.data(), &n, values.data(), work.data(), &work_size, &info);
  return info;
}

int calc_eigenpairs_by_division(Matrix& a, Vector& values) {
  const int n = static_cast<int>(a.rows()), work_size = 1 + 6 * n + 2 * n * n, integers_size = 3 + 5 * n;
  int info = 0;
  values.resize(n);
  std::vector<double> work(work_size);
  std::vector<int> integers(integers_size);
  Matrix kept = a;
  dsyevd_("V", "L", &n, a.data(), &n, values.data(), work.data(), &work_size, integers.data(), &integers_size, &info);
  if (info <= 0) return info;
  a.swap(kept);
  return calc_eigenpairs(a, values);
}

int calc_generalised_eigenpairs(Matrix& a, Matrix& b, Vector& values) {
  const int type = 1, n = static_cast<int>(a.rows()), work_size = calc_work_size(n);
  int info = 0;
  values.resize(n);
  std::vector<double> work(work_size);
  dsygv_(&type, "V", "L", &n, a.data(), &n, b.data(), &n, values.data(), work.data(), &work_size, &info);
  return info;
}

int calc_generalised_eigenpairs_by_division(Matrix& a, Matrix& b, Vector& values) {
  const int type = 1, n = static_cast<int>(a.rows()), ask = -1;
  int info = 0, integers_size = 0;
  double best_size = 0;
  values.resize(n);
  dsygvd_(&type, "V", "L", &n, a.data(), &n, b.data(), &n, values.data(), &best_size, &ask, &integers_size, &ask, &info);
  const int work_size = static_cast<int>(best_size);
  std::vector<double> work(work_size);
  std::vector<int> integers(integers_size);
  Matrix kept_a = a, kept_b = b;
  dsygvd_(&type, "V", "L", &n, a.data(), &n, b.data(), &n, values.data(), work.data(), &work_size, integers.data(), &integers_size, &info);
  if (info <= 0) return info;
  a.swap(kept_a);
  b.swap(kept_b);
  return calc_generalised_eigenpairs(a, b, values);
}

}  // namespace carillon::la

// Compiled once per instruction set, without contraction. All loops run along columns, element by element, so results do not depend on the
// instruction set. No templates of the standard library: the linker keeps one copy of them for all files, possibly one with unsupported
// instructions.
// Source: G. H. Golub, C. F. Van Loan, "Matrix Computations" (2013), algorithm 3.4.1.
#include "runtime/physics/impact/dense.hpp"

namespace carillon::impact::dense {

namespace {

inline void add(double* __restrict y, const double* __restrict x, double by, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) y[i] += by * x[i];
}

void add_columns(const double* A, std::size_t stride, const std::size_t* which, const double* x, std::size_t count, double* y,
                 std::size_t rows) {
  for (std::size_t j = 0; j < count; ++j)
    if (x[j] != 0.0) add(y, A + which[j] * stride, x[j], rows);
}

bool factorise(double* A, std::size_t n, std::size_t stride, std::size_t* pivots) {
  for (std::size_t k = 0; k < n; ++k) {
    double* column = A + k * stride;
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i)
      if (__builtin_fabs(column[i]) > __builtin_fabs(column[pivot])) pivot = i;
    if (!(__builtin_fabs(column[pivot]) > 0.0)) return false;
    pivots[k] = pivot;
    if (pivot != k)
      for (std::size_t j = 0; j < n; ++j) {
        const double at = A[j * stride + k];
        A[j * stride + k] = A[j * stride + pivot];
        A[j * stride + pivot] = at;
      }
    const double inverse = 1.0 / column[k];
    for (std::size_t i = k + 1; i < n; ++i) column[i] *= inverse;
    for (std::size_t j = k + 1; j < n; ++j) {
      double* other = A + j * stride;
      if (other[k] != 0.0) add(other + k + 1, column + k + 1, -other[k], n - k - 1);
    }
  }
  return true;
}

void substitute(const double* LU, std::size_t n, std::size_t stride, const std::size_t* pivots, double* x) {
  for (std::size_t k = 0; k < n; ++k) {
    const double at = x[k];
    x[k] = x[pivots[k]];
    x[pivots[k]] = at;
  }
  for (std::size_t k = 0; k < n; ++k) add(x + k + 1, LU + k * stride + k + 1, -x[k], n - k - 1);
  for (std::size_t k = n; k-- > 0;) {
    x[k] /= LU[k * stride + k];
    add(x, LU + k * stride, -x[k], k);
  }
}

}  // namespace
}  // namespace carillon::impact::dense

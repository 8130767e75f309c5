// Without contraction: all loops run along columns, element by element, so results do not depend on the instruction set.
// Source: G. H. Golub, C. F. Van Loan, "Matrix Computations" (2013), algorithm 3.4.1.
#include "runtime/physics/impact/dense.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::impact::dense::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

inline void add(double* __restrict y, const double* __restrict x, double by, std::size_t count) {
  const hn::CappedTag<double, 4> few;  // columns are short
  constexpr std::size_t kLanes = hn::MaxLanes(few);
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) hn::StoreU(hn::LoadU(few, y + i) + hn::Set(few, by) * hn::LoadU(few, x + i), few, y + i);
#pragma GCC unroll 4
  for (; i < count; ++i) y[i] += by * x[i];
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

const Functions& get_table() {
  static constexpr Functions kFunctions{add_columns, factorise, substitute};
  return kFunctions;
}

}  // namespace
}  // namespace carillon::impact::dense::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::impact::dense {

HWY_EXPORT(get_table);
const Functions& get_functions(base::Instructions best) { return base::choose(HWY_DISPATCH_TABLE(get_table), best)(); }

}  // namespace carillon::impact::dense
#endif

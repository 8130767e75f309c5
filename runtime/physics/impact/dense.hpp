// Small dense systems: sums of columns, and elimination. Matrices by columns, `stride` numbers from one to the next.
#pragma once

#include <cstddef>

namespace carillon::impact::dense {

/// One set of instructions. All give the same numbers.
struct Functions {
  /// y += sum over j of x[j] times column which[j] of A; y: (rows), x and which: (count).
  void (*add_columns)(const double* A, std::size_t stride, const std::size_t* which, const double* x, std::size_t count, double* y,
                      std::size_t rows);
  /// LU of A (n, n) in its place, with partial pivoting: step k exchanged rows k and pivots[k]. False where it is singular.
  bool (*factorise)(double* A, std::size_t n, std::size_t stride, std::size_t* pivots);
  /// x (n): b comes in, the solution of A x = b goes out. LU and pivots of factorise().
  void (*substitute)(const double* LU, std::size_t n, std::size_t stride, const std::size_t* pivots, double* x);
};

extern const Functions kPlain, kAvx2;

/// The best one that this processor has.
const Functions& get_functions();

}  // namespace carillon::impact::dense

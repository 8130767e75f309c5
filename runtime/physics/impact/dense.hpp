// Small dense systems: sums of columns, and elimination. Column-major, `stride` numbers per column.
#pragma once

#include <cstddef>

#include "runtime/base/instructions.hpp"

namespace carillon::impact::dense {

/// Implementation for one instruction set. All give the same results.
struct Functions {
  /// y += sum over j of x[j] times column which[j] of A; y: (rows), x and which: (count).
  void (*add_columns)(const double* A, std::size_t stride, const std::size_t* which, const double* x, std::size_t count, double* y,
                      std::size_t rows);
  /// In-place LU of A (n, n) with partial pivoting: step k exchanged rows k and pivots[k]. False if singular.
  bool (*factorise)(double* A, std::size_t n, std::size_t stride, std::size_t* pivots);
  /// x (n): in b, out the solution of A x = b. LU and pivots of factorise().
  void (*substitute)(const double* LU, std::size_t n, std::size_t stride, const std::size_t* pivots, double* x);
};

/// Implementation for the best supported instruction set up to `best`.
const Functions& get_functions(base::Instructions best = base::Instructions::kBest);

}  // namespace carillon::impact::dense

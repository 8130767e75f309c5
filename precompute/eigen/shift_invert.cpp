#include "precompute/eigen/shift_invert.hpp"

#include <algorithm>

#include "precompute/eigen/timer.hpp"
#include "precompute/petsc/work.hpp"

namespace carillon::eigen {

void ShiftInvert::apply(const Columns& b, const Columns& x) {
  {
    const petsc::WorkScope scope(petsc::WorkPhase::kSolve);
    const Timer timer(seconds_);
    const bool is_in_place = b.stride != x.stride;  // the factor takes one stride
    for (int j = 0; is_in_place && j < x.count; ++j) std::copy_n(b.column(j), x.rows, x.column(j));
    factor_.solve(is_in_place ? x.values : b.values, x.values, x.stride, x.count);
  }
  solves_ += x.count;
  if (after_solve_) after_solve_();
}

}  // namespace carillon::eigen

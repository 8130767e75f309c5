#include "precompute/eigen/scaling.hpp"

#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {

using petsc::check;

Scaling::Scaling(Mat mass, double lambda_high) {
  PetscScalar trace = 0;
  PetscInt n = 0;
  check(MatGetTrace(mass, &trace));
  check(MatGetSize(mass, &n, nullptr));
  if (!(trace > 0) || !std::isfinite(trace)) throw SolveError("The mass matrix has no positive trace. Look for elements without volume.");
  mass_power_ = 2 * static_cast<int>(std::lround(0.5 * std::log2(trace / n)));
  lambda_power_ = static_cast<int>(std::lround(std::log2(lambda_high)));
}

}  // namespace carillon::eigen

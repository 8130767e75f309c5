#include "precompute/eigen/scaling.hpp"

#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {

using petsc::check;

Scaling::Scaling(Mat stiffness, Mat mass, double lambda_high) : stiffness_(stiffness), mass_(mass) {
  PetscScalar trace = 0;
  PetscInt n = 0;
  check(MatGetTrace(mass, &trace));
  check(MatGetSize(mass, &n, nullptr));
  if (!(trace > 0) || !std::isfinite(trace)) throw SolveError("The mass matrix has no positive trace. Look for elements without volume.");
  mass_power_ = 2 * static_cast<int>(std::lround(0.5 * std::log2(trace / n)));
  lambda_power_ = static_cast<int>(std::lround(std::log2(lambda_high)));
  scale(1);
}

Scaling::~Scaling() {
  try {
    scale(-1);
  } catch (...) {  // Only a destroyed matrix can fail here.
  }
}

void Scaling::scale(int direction) {
  check(MatScale(mass_, std::ldexp(1.0, -direction * mass_power_)));
  check(MatScale(stiffness_, std::ldexp(1.0, -direction * (mass_power_ + lambda_power_))));
}

}  // namespace carillon::eigen

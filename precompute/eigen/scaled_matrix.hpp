// A matrix times a factor as an operator of PETSc.
#pragma once

#include <petscmat.h>

#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// factor * matrix for products with vectors, without a copy of the matrix, which must outlive this object.
class ScaledMatrix {
 public:
  /// Collective.
  ScaledMatrix(Mat matrix, double factor);
  ScaledMatrix(const ScaledMatrix&) = delete;
  ScaledMatrix& operator=(const ScaledMatrix&) = delete;

  operator Mat() const { return shell_; }

 private:
  static PetscErrorCode multiply(Mat shell, Vec x, Vec y);

  Mat matrix_;
  double factor_;
  petsc::MatHandle shell_;
};

}  // namespace carillon::eigen

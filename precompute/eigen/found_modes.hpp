// Modes found by a search.
#pragma once

#include <petscmat.h>

#include <cstddef>
#include <vector>

#include "precompute/eigen/locked_modes.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// Modes found so far, in the order of their discovery: M-orthonormal columns of a dense matrix with spare capacity.
class FoundModes {
 public:
  /// Drops all modes and reserves `capacity` columns with the rows of K. The rigid modes are stored separately. Collective.
  void reset(Mat stiffness, PetscInt capacity, const std::vector<petsc::VecHandle>& rigid);
  /// Adds an eigenpair; shape: the own rows. Collective.
  void add(double eigenvalue, const double* shape);
  /// The rigid modes and a range of modes that contains all above `low`, as references valid until a mode is added. Local.
  LockedModes find_above(double low) const;
  /// Returns the columns in the given order; this object is empty afterwards. Collective.
  petsc::MatHandle take(const std::vector<std::size_t>& order);
  /// Reserves `count` columns in total. Collective.
  void make_room(PetscInt count);
  /// The columns; those beyond lambda.size() are undefined.
  Mat get_columns() const { return columns_; }

  std::vector<double> lambda;

 private:
  petsc::MatHandle make_columns(PetscInt count) const;
  Mat stiffness_ = nullptr;
  petsc::MatHandle columns_;
  petsc::MatHandle rigid_;
  int rigid_count_ = 0;
  PetscInt capacity_ = 0;
};

}  // namespace carillon::eigen

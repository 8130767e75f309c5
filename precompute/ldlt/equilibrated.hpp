// K and M as they are factorised where stiffness spans many decades.
#pragma once

#include <vector>

#include "precompute/la/pencil.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::ldlt {

/// S K S and S M S, S a power of two per node that brings the diagonal of K near one: a soft part next to a stiff one, or an element a
/// thousand times thinner than its neighbours, then has pivots of its own size, not of the rounding of others. A body of one stiffness is
/// not copied. Borrows K and M, which must stay as they are: their values are read once, here.
class EquilibratedPencil {
 public:
  /// K, M: (3n, 3n) AIJ, whole nodes per rank. Collective. Throws SystemError on every rank when memory runs out.
  explicit EquilibratedPencil(const la::Pencil& given);

  const la::Pencil& get() const { return pencil_; }
  bool is_scaled() const { return static_cast<bool>(scaled_stiffness_); }
  /// X <- S X on this rank's rows, column-major.
  void scale(double* x, int stride, int columns) const;

 private:
  la::Pencil pencil_;
  petsc::MatHandle scaled_stiffness_;  // null where S is one
  petsc::MatHandle scaled_mass_;
  std::vector<double> factor_;  // (own rows), empty where S is one
};

}  // namespace carillon::ldlt

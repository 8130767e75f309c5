// Equilibrated K and M for stiffness that spans many decades.
#pragma once

#include <vector>

#include "precompute/la/pencil.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::ldlt {

/// S K S and S M S, S a power of two per node that scales the diagonal of K to about one: a soft part next to a stiff one, or an element a
/// thousand times thinner than its neighbours, then has pivots of its own magnitude instead of the rounding of others. Bodies of uniform
/// stiffness are not copied. Refers to K and M, which must not change: their values are read once, at construction.
class EquilibratedPencil {
 public:
  /// K, M: (3n, 3n) AIJ, whole nodes per rank. Collective. Throws SystemError on every rank if memory runs out.
  explicit EquilibratedPencil(const la::Pencil& given);

  const la::Pencil& get() const { return pencil_; }
  bool is_scaled() const { return static_cast<bool>(scaled_stiffness_); }
  /// X <- S X on this rank's rows, column-major.
  void scale(double* x, int stride, int columns) const;

 private:
  la::Pencil pencil_;
  petsc::MatHandle scaled_stiffness_;  // null if S is the identity
  petsc::MatHandle scaled_mass_;
  std::vector<double> factor_;  // (own rows), empty if S is the identity
};

}  // namespace carillon::ldlt

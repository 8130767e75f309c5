// The operator of a shift-invert iteration.
#pragma once

#include <cstdint>
#include <functional>
#include <utility>

#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/la/block_kernels.hpp"

namespace carillon::eigen {

using la::Columns;

/// (K - sigma M)^-1 for blocks of columns; counts its solves and their time.
class ShiftInvert {
 public:
  /// factor: factorised at sigma; must outlive this object. after_solve: called after each solve; may be empty.
  ShiftInvert(ShiftedFactor& factor, double sigma, std::function<void()> after_solve = {})
      : factor_(factor), sigma_(sigma), after_solve_(std::move(after_solve)) {}

  /// X <- (K - sigma M)^-1 B; b and x are the same columns or do not overlap. Collective.
  void apply(const Columns& b, const Columns& x);
  double get_sigma() const { return sigma_; }
  std::int64_t get_solves() const { return solves_; }  // right-hand sides
  double get_seconds() const { return seconds_; }

 private:
  ShiftedFactor& factor_;
  double sigma_;
  std::function<void()> after_solve_;
  std::int64_t solves_ = 0;
  double seconds_ = 0;
};

}  // namespace carillon::eigen

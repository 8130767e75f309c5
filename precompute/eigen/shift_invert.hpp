// The operator of a shift-invert iteration.
#pragma once

#include <slepcst.h>

namespace carillon::eigen {

/// W = A^-1 Z, A = K - sigma M, for blocks of columns. Keeps to the transformation that it is made of: the same solver, shift and options.
class ShiftInvert {
 public:
  /// st: set up, of type STSINVERT; must outlive it.
  explicit ShiftInvert(ST st);
  /// Z and W: dense, with the rows of K, as many columns in both. Collective.
  void apply(Mat z, Mat w) const;
  double get_sigma() const { return sigma_; }

 private:
  ST st_;
  PC direct_ = nullptr;  // A^-1 itself, where it is a shell: KSPMatSolve would write zeros over W first
  double sigma_ = 0;
};

}  // namespace carillon::eigen

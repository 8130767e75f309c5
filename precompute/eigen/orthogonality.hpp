// Estimated loss of orthogonality of a Lanczos basis (partial reorthogonalisation, Simon 1984).
#pragma once

#include <vector>

#include "precompute/eigen/locked_modes.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::eigen {

/// Where a block Lanczos iteration is between two blocks.
struct LanczosStep {
  const la::Matrix& t;  // projected operator, of which the first `size` rows and columns count
  int size = 0;         // columns of the basis V,
  int width = 0;        // of its last block V_j,
  int previous = 0;     // and the first column of the block before
};

/// Keeps an estimate of W_j = V^T M V_j for the last two blocks, by the recurrence that the basis itself obeys: no entry of W_j is larger
/// than what is estimated but for rounding that it has not met yet. Small matrices only; the same on every rank, not collective.
class OrthogonalityEstimate {
 public:
  /// Nothing is known of the basis: the next two steps are to project.
  void reset();
  /// Before the projection: whether w = A V_j - V_j alpha - V_{j-1} R^T, made a block, stays semi-orthogonal without it. alpha: (width,
  /// width).
  bool can_skip_reorthogonalisation(const LanczosStep& step, const la::Matrix& alpha);
  /// After the first pass of a projection: c = V^T M w as it was measured, (size, width) with stride `stride`. What was not predicted is
  /// rounding, and expected again.
  void update_noise(const LanczosStep& step, const double* c, int stride);
  /// After the last pass of a projection, which took `norm` away from a column at most: V is not quite orthogonal, and leaves a part of it.
  void record_projection(double norm);
  /// After the last pass, skipped or not: what was subtracted of locked modes has left at most this much along the basis
  /// (DeflationEstimate::calc_returned).
  void record_deflation(double returned) { returned_ = returned; }
  /// After the step: whether w, made a block with R (next_width, width), was right to skip the projection, or to stop after as many passes
  /// as it had. R is known only then, and where the space is nearly exhausted it shrinks w by far more than the R before.
  bool is_confirmed(const LanczosStep& step, const la::Matrix& r, bool is_skipped) const;
  /// The block with R (next_width, width) becomes the last one.
  void advance(const LanczosStep& step, const la::Matrix& r, bool is_skipped);

  /// W_j of the last block as it is estimated, (size, width); empty: nothing is known.
  const la::Matrix& last() const { return last_; }

 private:
  la::Matrix predicted_;  // V^T M w, (size, width)
  double largest_ = 0;    // of it and of noise_
  la::Matrix last_;       // W_j, (size, width)
  la::Matrix before_;     // W_{j-1}, (size, width of that block)
  double noise_ = 0;      // what rounding adds to V^T M w; 0: not yet measured
  double worst_ = 0;      // entry of V^T M V - 1 so far
  double left_ = 0;       // of V^T M w by the projection
  double returned_ = 0;   // to V^T M w with what was taken of locked modes
  double divisor_ = 0;    // by which R shrinks w at most, from the last step
  int since_skipped_ = 0;
};

/// Keeps the same estimate for locked eigenvectors L of the operator: L^T M of the last two blocks. Their rows obey recurrences of their
/// own, and few of them grow: those of the columns nearest to the shift. About 1e-10 of the others may remain. Small matrices only; the
/// same on every rank, not collective.
class DeflationEstimate {
 public:
  DeflationEstimate() = default;
  /// theta: (count) eigenvalues of the operator.
  explicit DeflationEstimate(std::vector<double> theta);

  void reset();
  /// Before the projection: the columns that must be projected out of w, made a block. alpha: (width, width).
  LockedRange find_columns_to_project(const LanczosStep& step, const la::Matrix& alpha);
  /// c = L^T M w of a range as it was measured, (range.count, width).
  void update_noise(LockedRange range, const la::Matrix& c);
  /// An entry of V^T M L c at most, c = L^T M w of a range that is being subtracted from w.
  double calc_returned(LockedRange range, const la::Matrix& c) const;
  bool is_confirmed(const LanczosStep& step, const la::Matrix& r) const;
  /// After the step, which projected `range` out.
  void advance(const LanczosStep& step, const la::Matrix& r, LockedRange range);
  LockedRange all() const { return {0, static_cast<int>(theta_.size())}; }
  /// (count) the largest entries of L^T M V_j that remained, as predicted, or as a later step has shown.
  const std::vector<double>& get_remaining() const { return remaining_; }

 private:
  std::vector<double> theta_;
  la::Matrix predicted_;       // L^T M w, (count, width)
  double largest_ = 0;         // of its rows that are not projected out
  double scale_ = 0;           // largest entry of alpha
  la::Matrix last_;            // L^T M V_j
  la::Matrix before_;          // L^T M V_{j-1}
  std::vector<double> noise_;  // (count) what rounding, and the error of the eigenvector, add to a row
  std::vector<double> remaining_;
  double divisor_ = 0;
  int clean_ = 0;  // blocks in a row that all locked columns were projected out of
};

}  // namespace carillon::eigen

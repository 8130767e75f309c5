// Estimated loss of orthogonality of a Lanczos basis (partial reorthogonalisation, Simon 1984).
#pragma once

#include <vector>

#include "precompute/eigen/locked_modes.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::eigen {

/// State of a block Lanczos iteration between two blocks.
struct LanczosStep {
  const la::Matrix& t;  // projected operator; its first `size` rows and columns are valid
  int size = 0;         // columns of the basis V,
  int width = 0;        // of its last block V_j,
  int previous = 0;     // first column of the block before
};

/// Estimates W_j = V^T M V_j for the last two blocks by the recurrence of the basis itself. The estimate bounds every entry of W_j except
/// for rounding not measured yet. Small matrices only; the same on all ranks, not collective.
class OrthogonalityEstimate {
 public:
  /// Discards all estimates: the next two steps project.
  void reset();
  /// Before the projection: true if the next block, from w = A V_j - V_j alpha - V_{j-1} R^T, stays semi-orthogonal without it. alpha:
  /// (width, width).
  bool can_skip_reorthogonalisation(const LanczosStep& step, const la::Matrix& alpha);
  /// After the first pass of a projection: measured c = V^T M w, (size, width) with stride `stride`. The deviation from the prediction is
  /// rounding, and is expected again.
  void update_noise(const LanczosStep& step, const double* c, int stride);
  /// After the last pass of a projection that removed at most `norm` from a column: V is only nearly orthogonal and leaves a part of it.
  void record_projection(double norm);
  /// After the last pass, skipped or not: bound on the error along the basis left by subtracting locked modes
  /// (DeflationEstimate::calc_returned).
  void record_deflation(double returned) { returned_ = returned; }
  /// After the step, with R (next_width, width): true if skipping the projection, or stopping after the passes made, was justified. R is
  /// known only then; where the space is nearly exhausted it shrinks w far more than the preceding R.
  bool is_confirmed(const LanczosStep& step, const la::Matrix& r, bool is_skipped) const;
  /// Appends the block with R (next_width, width).
  void advance(const LanczosStep& step, const la::Matrix& r, bool is_skipped);

  /// Estimated W_j of the last block, (size, width); empty if unknown.
  const la::Matrix& last() const { return last_; }

 private:
  la::Matrix predicted_;  // V^T M w, (size, width)
  double largest_ = 0;    // largest entry of predicted_ and noise_
  la::Matrix last_;       // W_j, (size, width)
  la::Matrix before_;     // W_{j-1}, (size, width of that block)
  double noise_ = 0;      // rounding added to V^T M w; 0 if not measured yet
  double worst_ = 0;      // largest entry of V^T M V - 1 so far
  double left_ = 0;       // part of V^T M w left by the projection
  double returned_ = 0;   // part of V^T M w added by subtracting locked modes
  double divisor_ = 0;    // largest factor by which R of the last step shrinks w
  int since_skipped_ = 0;
};

/// The same estimate for locked eigenvectors L of the operator: L^T M of the last two blocks. Each row obeys its own recurrence, and only
/// the rows of modes near the shift grow. About 1e-10 of the other modes may remain. Small matrices only; the same on all ranks, not
/// collective.
class DeflationEstimate {
 public:
  DeflationEstimate() = default;
  /// theta: (count) eigenvalues of the operator.
  explicit DeflationEstimate(std::vector<double> theta);

  void reset();
  /// Before the projection: columns that must be projected out of the next block. alpha: (width, width).
  LockedRange find_columns_to_project(const LanczosStep& step, const la::Matrix& alpha);
  /// Measured c = L^T M w of a range, (range.count, width).
  void update_noise(LockedRange range, const la::Matrix& c);
  /// Bound on the entries of V^T M L c, c = L^T M w of a range that is subtracted from w.
  double calc_returned(LockedRange range, const la::Matrix& c) const;
  bool is_confirmed(const LanczosStep& step, const la::Matrix& r) const;
  /// After the step that projected out `range`.
  void advance(const LanczosStep& step, const la::Matrix& r, LockedRange range);
  LockedRange all() const { return {0, static_cast<int>(theta_.size())}; }
  /// (count) largest remaining entries of L^T M V_j, as predicted or as measured in a later step.
  const std::vector<double>& get_remaining() const { return remaining_; }

 private:
  std::vector<double> theta_;
  la::Matrix predicted_;       // L^T M w, (count, width)
  double largest_ = 0;         // largest entry of its rows that are not projected out
  double scale_ = 0;           // largest entry of alpha
  la::Matrix last_;            // L^T M V_j
  la::Matrix before_;          // L^T M V_{j-1}
  std::vector<double> noise_;  // (count) rounding and eigenvector error added to a row
  std::vector<double> remaining_;
  double divisor_ = 0;
  int clean_ = 0;  // consecutive blocks with all locked columns projected out
};

}  // namespace carillon::eigen

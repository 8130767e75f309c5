// What is known of the orthogonality of a Lanczos basis without looking at it.
#pragma once

#include <petscsys.h>

#include <cstddef>
#include <vector>

namespace carillon::eigen {

/// V^T M V_j of the last two blocks of a block Lanczos basis, carried along by the recurrence that the basis itself obeys. It tells a step
/// whether it may leave out the projection against the whole basis. Small matrices only; the same on every rank, not collective.
class Orthogonality {
 public:
  /// Where the iteration stands.
  struct State {
    const double* t = nullptr;  // projected operator, column-major
    int stride = 0;             // of t
    int size = 0;               // columns of the basis,
    int width = 0;              // of its last block,
    int previous = 0;           // and the first column of the block before
  };

  /// Nothing is known of the basis: the next two steps are told to project.
  void forget();
  /// Before the projection: whether w = A V_j - V_j alpha - V_{j-1} R^T, made a block, would do without. alpha: (width, width).
  bool is_good(const State& state, const double* alpha);
  /// After the first pass of a projection: c = V^T M w as it was measured, (size, width) with stride `stride`. What was not predicted is
  /// rounding, and expected again.
  void learn(const State& state, const double* c, int stride);
  /// After the last pass of a projection, which took `norm` away from a column at most: V is not quite orthogonal, and leaves a part of it.
  void clear(double norm);
  /// After the last pass, spared or not: what the step took out of w of locked modes has left at most this much along the basis, which is
  /// not quite orthogonal to them (LockedOrthogonality::calc_returned).
  void put_back(double returned) { returned_ = returned; }
  /// After the step: whether w, made a block with R (next_width, width), did without the projection indeed, or with as many passes as it
  /// had. R is known only then, and where the space is nearly exhausted it shrinks w by far more than the R before.
  bool is_still_good(const State& state, const std::vector<double>& r, int next_width, bool is_spared) const;
  /// After the step: its R (next_width, width), and whether the projection was left out.
  void advance(const State& state, const std::vector<double>& r, int next_width, bool is_spared);

 private:
  std::vector<double> predicted_;  // V^T M w, (size, width)
  double largest_ = 0;             // of it and of noise_
  std::vector<double> last_;       // V^T M V_j, (size, width)
  std::vector<double> before_;     // V^T M V_{j-1}, (size, width of that block)
  double noise_ = 0;               // what rounding adds to V^T M w; 0: not yet measured
  double worst_ = 0;               // entry of V^T M V - 1 so far
  double left_ = 0;                // of V^T M w by the projection
  double returned_ = 0;            // to V^T M w with what was taken of locked modes
  double divisor_ = 0;             // by which R shrinks w at most, from the last step
  int since_spared_ = 0;
};

/// Columns [first, first + count) of what is locked.
struct LockedRange {
  int first = 0;
  int count = 0;
};

/// The same for eigenvectors of the operator that the basis is kept M-orthogonal to, L: L^T M of the last two blocks. Their rows obey
/// recurrences of their own, and few of them grow: those of the columns nearest to what is sought. The others are left standing, about
/// 1e-10 of them. Small matrices only; the same on every rank, not collective.
class LockedOrthogonality {
 public:
  LockedOrthogonality() = default;
  /// theta: (count) eigenvalues of the operator.
  explicit LockedOrthogonality(std::vector<double> theta);

  /// As of Orthogonality.
  void forget();
  /// Before the projection: what w, made a block, must be cleared of; everything else it would do without. alpha: (width, width).
  LockedRange find_lossy(const Orthogonality::State& state, const double* alpha);
  /// c = L^T M w of a range as it was measured, (range.count, width).
  void learn(LockedRange range, const double* c, int width);
  /// An entry of V^T M L c at most, c = L^T M w of a range that is being subtracted from w.
  double calc_returned(LockedRange range, const std::vector<double>& c, int width) const;
  bool is_still_good(const Orthogonality::State& state, const std::vector<double>& r, int next_width) const;
  /// After the step, which was cleared of `range`.
  void advance(const Orthogonality::State& state, const std::vector<double>& r, int next_width, LockedRange range);
  LockedRange get_all() const { return {0, static_cast<int>(theta_.size())}; }
  /// (count) the largest entries of L^T M V_j that remained, as predicted, or as a later step has shown.
  const std::vector<double>& get_left() const { return left_; }

 private:
  std::vector<double> theta_;
  std::vector<double> predicted_;  // L^T M w, (count, width)
  double largest_ = 0;             // of its rows that are not lossy
  double scale_ = 0;               // largest entry of alpha
  std::vector<double> last_;       // L^T M V_j
  std::vector<double> before_;     // L^T M V_{j-1}
  std::vector<double> noise_;      // (count) what rounding, and the error of the eigenvector, add to a row
  std::vector<double> left_;
  double divisor_ = 0;
  int clean_ = 0;  // blocks in a row that were cleared of everything
};

}  // namespace carillon::eigen

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
  /// After the first pass of a projection: c = V^T M w as it was measured, (size, width) with stride `stride`. What was not foreseen is
  /// rounding, and expected again.
  void learn(const State& state, const double* c, int stride);
  /// After a step that was spared the projection: whether w, made a block with R (next_width, width), did without indeed. R is known only
  /// then, and where the space is nearly exhausted it shrinks w by far more than the R before.
  bool is_still_good(const State& state, const std::vector<double>& r, int next_width) const;
  /// After the step: its R (next_width, width), and whether the projection was left out.
  void advance(const State& state, const std::vector<double>& r, int next_width, bool is_spared);

 private:
  std::vector<double> foreseen_;  // V^T M w, (size, width)
  double largest_ = 0;            // of it and of noise_
  std::vector<double> last_;      // V^T M V_j, (size, width)
  std::vector<double> before_;    // V^T M V_{j-1}, (size, width of that block)
  double noise_ = 0;              // what rounding adds to V^T M w; 0: not yet measured
  double divisor_ = 0;            // by which R shrinks w at most, from the last step
  int since_spared_ = 0;
};

}  // namespace carillon::eigen

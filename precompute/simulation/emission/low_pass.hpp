// Low-pass of OCE01 from steps to samples. Internal to carillon::emission.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "precompute/simulation/emission/loops.hpp"
#include "precompute/simulation/emission/rows.hpp"

namespace carillon::emission {

/// Filters many signals (rows) by OCE01 eq. 6 and 7: a sinc with fmax = half the sample rate under a Hann window of kHalfWidth samples per
/// side, w = ceil(3 / (fmax h)) steps. Invariant: every sample is normalised by the sum of its weights. Rows: a multiple of kLane.
class LowPass {
 public:
  static constexpr int kHalf = kSlots / 2;  // samples on either side
  static constexpr double kHalfWidth = 6.0;

  /// An interval between two samples has `values` values; the first is offset by `first` value spacings from its beginning.
  LowPass(std::size_t rows, int values, double first);

  /// Value i of this interval: (rows).
  void add(int i, const double* value);
  /// Ends interval n: out (rows) becomes sample n + 1 - kHalf.
  void close(double* out);

  template <typename Visit>
  void visit_state(Visit&& visit) {
    take_in();  // same order of summation
    visit(ring_, weights_, open_);
  }

 private:
  void take_in();

  std::size_t rows_;
  const RowLoops* loops_ = &find_loops();
  int ring_ = 0;                                        // slot of the oldest open sample
  std::vector<std::array<double, 2 * kSlots>> weight_;  // (values), twice, for any ring offset
  std::array<double, kSlots> weights_{};                // sum of weights of each open sample
  std::vector<double> open_;                            // (rows, kSlots)
  std::vector<double> waiting_;                         // (kValuesPerCall, rows): values not yet in open_
  std::array<const double*, kValuesPerCall> waiting_weight_{};
  std::size_t waiting_count_ = 0;
};

}  // namespace carillon::emission

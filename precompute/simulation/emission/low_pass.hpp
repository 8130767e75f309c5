// The low-pass of OCE01 from steps to samples. Internal to carillon::emission.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/simulation/emission/loops.hpp"
#include "precompute/simulation/emission/rows.hpp"

namespace carillon::emission {

/// Many signals (rows), each filtered by OCE01 eq. 6 and 7, a sinc with fmax = half the sample rate under a Hann window of kHalfWidth
/// samples a side, w = ceil(3 / (fmax h)) steps. Invariant: every sample is a sum of weights that is divided by their sum. Rows: a
/// multiple of kLane.
class LowPass {
 public:
  static constexpr int kHalf = kSlots / 2;  // samples on either side
  static constexpr double kHalfWidth = 6.0;

  /// An interval between two samples has `values` values; the first lies `first` of a distance between two values behind its beginning.
  LowPass(std::size_t rows, int values, double first);

  /// Value i of this interval: (rows).
  void add(int i, const double* value);
  /// Ends interval n: out (rows) becomes sample n + 1 - kHalf.
  void close(double* out);

  template <typename Visit>
  void visit_state(Visit&& visit) {
    take_in();  // the order of the sum is the same
    visit(ring_, weights_, open_);
  }

 private:
  void take_in();

  std::size_t rows_;
  const RowLoops* loops_ = &find_loops();
  int ring_ = 0;                                        // slot of the oldest open sample
  std::vector<std::array<double, 2 * kSlots>> weight_;  // (values), twice in a row, so that any beginning of the ring has a run
  std::array<double, kSlots> weights_{};                // of each open sample, summed
  std::vector<double> open_;                            // (rows, kSlots)
  std::vector<double> waiting_;                         // (kTogether, rows): values that are not yet in open_
  std::array<const double*, kTogether> waiting_weight_{};
  std::size_t waiting_count_ = 0;
};

}  // namespace carillon::emission

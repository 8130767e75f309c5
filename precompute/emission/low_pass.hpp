// From values at the rate of a simulation to samples at the audio rate. Internal to carillon::emission.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/emission/loops.hpp"

namespace carillon::emission {

/// kFlat: a sinc under a Kaiser window (beta 6.25) over 24 samples, flat to 5/12 of the sample rate (20 kHz at 48 kHz), -60 dB from 7/12
/// on. kHann2001: OCE01 eq. 6 and 7, a sinc with fmax = half the sample rate under a Hann window, w = ceil(3 / (fmax h)) steps a side.
enum class Kernel : std::uint8_t { kFlat, kHann2001 };

/// Many signals (rows), each filtered by the same kernel. What it keeps true: every sample is a sum of weights that is divided by their
/// sum; with kFlat the first moment of the weights is taken out, too, so that uniform motion passes exactly even where the rate of the
/// values changes. Rows: a multiple of kLane.
class LowPass {
 public:
  static constexpr int kHalf = kSlots / 2;  // samples on either side

  LowPass(std::size_t rows, Kernel kernel);

  /// From the next interval between two samples on, it has `values` values; the first lies `first` of a distance between two values
  /// behind its beginning. half_width: of kHann2001, in samples, <= kHalf.
  void set_rate(int values, double first, double half_width = 6.0);
  /// Value i of this interval: (rows).
  void add(int i, const double* value);
  /// Ends interval n: out (rows) becomes sample n + 1 - kHalf.
  void close(double* out);

  /// State, for checkpoints.
  void save(std::vector<std::byte>& to);
  void load(std::span<const std::byte>& from);

 private:
  void take_in();

  std::size_t rows_;
  Kernel kernel_;
  const RowLoops* loops_;
  int ring_ = 0;                                        // slot of the oldest open sample
  std::vector<std::array<double, 2 * kSlots>> weight_;  // (values), twice in a row, so that any beginning of the ring has a run
  std::vector<std::array<double, 2 * kSlots>> moment_;  // times the distance in time from the sample
  std::array<double, kSlots> weights_{}, moments_{};    // of each open sample, summed
  std::vector<double> open_;                            // (rows, kSlots)
  std::vector<double> last_;                            // (rows) the sample before
  bool has_last_ = false;
  std::vector<double> waiting_;  // (kTogether, rows): values that are not yet in open_
  std::array<const double*, kTogether> waiting_weight_{};
  std::size_t waiting_count_ = 0;
};

}  // namespace carillon::emission

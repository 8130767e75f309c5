// A signal at another sample rate.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace carillon::recording {

/// One signal, sample by sample as it comes: what lies between samples is read by the windowed sinc of runtime/base/sinc.hpp, stretched to
/// the lower of the two rates. Invariant: a constant passes as it is; sample n of the output is the input at the same time, n /
/// to_hz; before its first sample and after its last the input is 0. Flat within 0.01 dB to 0.4 of the lower rate, -90 dB from 0.6 on.
class Resampler {
 public:
  /// Rates that are positive. Costs 32 products a sample of the output, or of the input where that is faster.
  Resampler(double from_hz, double to_hz);

  /// Samples that must be added before so many can be taken.
  std::size_t count_missing(std::size_t outputs) const;
  void add(std::span<const double> input);
  /// The next samples. Pre: count_missing() of them is 0.
  void take(std::span<double> output);

 private:
  double step_ = 1.0;       // input samples from one output sample to the next
  double stretch_ = 1.0;    // of the sinc, in input samples
  std::int64_t reach_ = 0;  // input samples to either side
  std::vector<double> input_;
  std::int64_t first_ = 0;  // of input_, counted from the beginning
  std::uint64_t taken_ = 0;
};

}  // namespace carillon::recording

// Streaming sample-rate converter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace carillon::recording {

/// One signal: interpolation by the windowed sinc of runtime/base/sinc.hpp, stretched to the lower of the two rates. Invariant: constants
/// are preserved; output sample n is the input at time n / to_hz; the input is 0 before its first and after its last sample. Flat within
/// 0.01 dB to 0.4 of the lower rate, -90 dB from 0.6 on.
class Resampler {
 public:
  /// Positive rates. Cost: 32 products per output sample, or per input sample when downsampling.
  Resampler(double from_hz, double to_hz);

  /// Input samples needed for so many outputs.
  std::size_t count_missing(std::size_t outputs) const;
  void add(std::span<const double> input);
  /// The next samples. Pre: count_missing() of them is 0.
  void take(std::span<double> output);

 private:
  double step_ = 1.0;       // input samples from one output sample to the next
  double stretch_ = 1.0;    // stretch of the sinc, in input samples
  std::int64_t reach_ = 0;  // input samples to either side
  std::vector<double> input_;
  std::int64_t first_ = 0;  // index of input_[0] in the signal
  std::uint64_t taken_ = 0;
};

}  // namespace carillon::recording

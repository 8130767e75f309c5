// Reading between samples: a sinc under a Kaiser window.
#pragma once

#include <array>
#include <cstddef>

namespace carillon::base {

inline constexpr int kSincTaps = 32;             // samples that one reading takes
inline constexpr int kSincHalf = kSincTaps / 2;  // of them before the place
inline constexpr int kSincPhases = 512;          // places between two samples that are tabulated; linear between them

/// The table that all share: it does not change once it is there. Flat within 0.01 dB to 0.4 of the sample rate, stop band -90 dB.
class Sinc {
 public:
  /// Made with the first call, which is not for an audio thread.
  static const Sinc& get();

  /// The value at x samples from the middle; 0 from kSincHalf on.
  double evaluate(double x) const noexcept;

  /// A delay by kSincHalf - 1 + fraction samples: the sum over j of taps[j] x[n - j]. 0 <= fraction <= 1; the taps sum to 1.
  /// [audio-thread]
  void make_delay(double fraction, std::array<float, kSincTaps>& taps) const noexcept;

  /// The taps of a delay by kSincHalf - 1 + phase / kSincPhases samples, 0 <= phase <= kSincPhases; behind them those of the next phase.
  /// [audio-thread]
  const float* get_taps(int phase) const noexcept { return delays_[phase].data(); }

 private:
  Sinc();

  std::array<std::array<float, kSincTaps>, kSincPhases + 1> delays_{};  // by phase
  std::array<double, kSincHalf * kSincPhases + 2> value_{};             // by distance, in steps of 1 / kSincPhases
};

}  // namespace carillon::base

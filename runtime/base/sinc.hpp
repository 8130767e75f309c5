// Band-limited interpolation of samples: Kaiser-windowed sinc.
#pragma once

#include <array>
#include <cstddef>

namespace carillon::base {

inline constexpr int kSincTaps = 32;             // samples per interpolation
inline constexpr int kSincHalf = kSincTaps / 2;  // of them before the position
inline constexpr int kSincPhases = 512;          // tabulated phases between two samples; linear between them

/// Shared constant table. Flat within 0.01 dB up to 0.4 of the sample rate, stop band -90 dB.
class Sinc {
 public:
  /// Built on the first call; do not make that one on an audio thread.
  static const Sinc& get();

  /// Kernel at x samples from the centre; 0 from kSincHalf on.
  double evaluate(double x) const noexcept;

  /// FIR taps of a delay of kSincHalf - 1 + fraction samples: y[n] = sum over j of taps[j] x[n - j]. 0 <= fraction <= 1; the taps sum to 1.
  /// [audio-thread]
  void make_delay(double fraction, std::array<float, kSincTaps>& taps) const noexcept;

  /// Taps of a delay of kSincHalf - 1 + phase / kSincPhases samples, 0 <= phase <= kSincPhases; the next phase follows in memory.
  /// [audio-thread]
  const float* get_taps(int phase) const noexcept { return delays_[phase].data(); }

 private:
  Sinc();

  std::array<std::array<float, kSincTaps>, kSincPhases + 1> delays_{};  // by phase
  std::array<double, kSincHalf * kSincPhases + 2> value_{};             // by distance, in steps of 1 / kSincPhases
};

}  // namespace carillon::base

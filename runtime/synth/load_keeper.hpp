// From "this share of a core" to a budget of mode-samples, by what process() was measured to take.
//
//   synth::LoadKeeper keeper;
//   keeper.keep(synthesiser, 0.3, busy_s);  // ten times a second, outside the audio thread; the host measures busy_s around process()
#pragma once

#include <cstdint>

#include "runtime/synth/synthesiser.hpp"

namespace carillon::synth {

/// What was done up to some time.
struct LoadSample {
  double busy_s = 0.0;        // that process() took
  double played_s = 0.0;      // of sound
  double mode_samples = 0.0;  // of work
};

/// One thread, any but the audio thread.
class LoadKeeper {
 public:
  /// The budget from now on. Less than 20 ms of sound since the last call change nothing, nor does time that runs backwards.
  double calc_budget(double share, const LoadSample& now, double budget) noexcept;

  /// The same for a synthesiser. share: of one core, 0.01 to 1; busy_s: the time that process() has taken altogether.
  void keep(Synthesiser& synthesiser, double share, double busy_s) noexcept;

 private:
  LoadSample last_;
};

}  // namespace carillon::synth

// Controls the budget of mode-samples by the measured time of process().
//
//   synth::LoadKeeper keeper;
//   keeper.keep(synthesiser, 0.3, busy_s);  // ten times a second, outside the audio thread; the host measures busy_s around process()
#pragma once

#include "runtime/synth/synthesiser.hpp"

namespace carillon::synth {

/// Totals at a time.
struct LoadSample {
  double busy_s = 0.0;        // time in process()
  double played_s = 0.0;      // rendered time
  double mode_samples = 0.0;  // work
};

/// One thread, not the audio thread.
class LoadKeeper {
 public:
  /// New budget. No change within 20 ms of sound since the last call, or if time runs backwards.
  double calc_budget(double share, const LoadSample& now, double budget) noexcept;

  /// Sets the budget of a synthesiser. share: of one core, 0.01 to 1; busy_s: total time in process().
  void keep(Synthesiser& synthesiser, double share, double busy_s) noexcept;

 private:
  LoadSample last_;
};

}  // namespace carillon::synth

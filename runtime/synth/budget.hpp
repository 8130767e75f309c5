// Selects the most audible modes of all bodies within a budget.
//
//   synth::Budget budget;
//   if (budget.begin(allowed, spent, live)) {              // at the start of a block
//     for (each awake body) budget.add(modes.measure(nearness));
//     budget.decide();
//     for (each awake body) modes.truncate(budget.find_limit(modes.get_measured()));
//   }
//   modes.set_floor(budget.get_floor_pa() / nearness);    // of every body
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>

namespace carillon::synth {

/// Deterministic function of its inputs: no clock, no order of threads. Does not allocate. One thread.
class Budget {
 public:
  /// At the start of a block. `allowed`: mode-samples of this block, `spent`: of the last block, `live_groups`: ringing groups of
  /// `awake_bodies` bodies. True if groups must be removed. Additional work (strikes, woken groups, fade-outs) is predicted from the last
  /// blocks; overdraft is repaid over the next ones.
  bool begin(double allowed, double spent, std::int64_t live_groups, int awake_bodies) noexcept;

  /// After begin(): true if a tenth of the allowance is unused.
  bool has_room() const noexcept { return has_room_; }

  /// Bounds on the pressure at the receivers [Pa] of the groups of an awake body, non-increasing.
  void add(std::span<const float> bounds_pa) noexcept;

  /// After all add() calls: finds the pressure below which groups are removed.
  void decide() noexcept;

  /// Number of groups that a body keeps, at least one. Call once per body, in the order of add().
  int find_limit(std::span<const float> bounds_pa) noexcept;

  /// Strikes must not wake groups that they cannot lift to this pressure at the receivers; 0: no floor.
  float get_floor_pa() const noexcept { return threshold_pa_ * strictness_; }

 private:
  static constexpr int kStepsPerOctave = 8;  // histogram resolution: 0.75 dB
  static constexpr int kBins = 256 * kStepsPerOctave;
  static int find_bin(float pressure_pa) noexcept;

  double planned_ = std::numeric_limits<double>::infinity();  // mode-samples of the ringing groups of the last block
  double allowed_ = std::numeric_limits<double>::infinity();  // of the last block
  double extra_ = 0.0;                                        // additional work, smoothed
  double debt_ = 0.0;                                         // overdraft, mode-samples
  bool has_room_ = false;
  float strictness_ = 1.0F;
  float threshold_pa_ = 0.0F;                // last threshold
  std::int64_t room_ = 0;                    // groups allowed beyond the first of each body
  std::array<std::int32_t, kBins> count_{};  // groups by the logarithm of their bound
  int last_bin_ = 0;                         // bin of which some groups stay; all groups in higher bins stay
  std::int64_t last_room_ = 0;               // groups of that bin that may stay
};

}  // namespace carillon::synth

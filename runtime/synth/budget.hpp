// Which modes stay when there are more than the budget allows: the most audible ones, over all bodies.
//
//   synth::Budget budget;
//   if (budget.begin(allowed, spent, live)) {              // at the start of a block
//     for (each awake body) budget.add(voice.measure(nearness));
//     budget.decide();
//     for (each awake body) voice.cut(budget.find_limit(voice.get_measured()));
//   }
//   voice.set_floor(budget.get_floor_pa() / nearness);    // of every body
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>

namespace carillon::synth {

/// What it decides depends on what was added and on nothing else: no clock, no order of threads. Takes no memory. One thread.
class Budget {
 public:
  /// At the start of a block: mode-samples that it may take, those that the last block took, and the groups that are live now, of how
  /// many bodies. True when some must go. Work on top of the live groups (strikes, what they wake, what fades out) is predicted from the
  /// last blocks; what was taken too much is given back over the next ones.
  bool begin(double allowed, double spent, std::int64_t live_groups, int awake_bodies) noexcept;

  /// After begin(): whether a tenth of what is allowed is to spare, all work taken into account.
  bool has_room() const noexcept { return has_room_; }

  /// The groups of one awake body: bounds on their pressure at the receivers [Pa], never growing along the list.
  void add(std::span<const float> bounds_pa) noexcept;

  /// Once all were added: finds the pressure below which groups go.
  void decide() noexcept;

  /// How many groups of a body stay, at least one. In the order of add(), once a body.
  int find_limit(std::span<const float> bounds_pa) noexcept;

  /// Strikes shall wake no group that they cannot lift to this pressure at the receivers; 0: no such floor.
  float get_floor_pa() const noexcept { return threshold_pa_ * strictness_; }

 private:
  static constexpr int kStepsPerOctave = 8;  // of the histogram: 0.75 dB
  static constexpr int kBins = 256 * kStepsPerOctave;
  static int find_bin(float pressure_pa) noexcept;

  double planned_ = std::numeric_limits<double>::infinity();  // of the live groups of the last block, mode-samples
  double allowed_ = std::numeric_limits<double>::infinity();  // in the last block
  double extra_ = 0.0;                                        // what came on top, smoothed
  double debt_ = 0.0;                                         // taken too much so far, mode-samples
  bool has_room_ = false;
  float strictness_ = 1.0F;
  float threshold_pa_ = 0.0F;                // of the last choice
  std::int64_t room_ = 0;                    // groups that may stay beyond the first of each body
  std::array<std::int32_t, kBins> count_{};  // groups by the logarithm of their bound
  int last_bin_ = 0;                         // of which some stay; those above all do
  std::int64_t last_room_ = 0;               // how many of it
};

}  // namespace carillon::synth

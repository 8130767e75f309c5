// Waiting and active strikes: contact pulses of known shape, and forces known step by step.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/pulse.hpp"

namespace carillon::synth {

/// Interval of a non-zero force, in samples of its owner. The interval of sample n is (n - 1, n].
struct ForceInterval {
  double begin = 0.0, end = 0.0;
  /// True if it overlaps the intervals of `count` samples from `sample` on.
  bool overlaps(std::int64_t sample, int count) const noexcept {
    return begin <= static_cast<double>(sample + count - 1) && end > static_cast<double>(sample - 1);
  }
};

/// A contact pulse.
struct QueuedPulse {
  double begin = 0.0, length = 0.0;  // samples
  events::PulseShape shape = events::PulseShape::kHertz;
  const std::int16_t* row[kStrikeRows];  // of the model's shapes
  float weight[kStrikeRows];
  float strength_n_s = 0.0F;  // magnitude of the impulse
  std::int32_t triangle = 0;

  ForceInterval get_interval() const noexcept { return {begin, begin + length}; }
};

/// A force in steps of equal length, along as many axes as its steps need: one if all are parallel.
struct QueuedForce {
  double begin = 0.0, step = 0.0;  // samples
  std::int32_t triangle = 0;
  int count = 0, axes = 0;
  float strength_n_s = 0.0F;  // bound on the impulse
  float barycentric[3];
  float axis[3][3];                        // unit
  float along[3][events::kMaxForceSteps];  // impulse of each step along each [N s]

  double calc_end() const noexcept { return begin + count * step; }
  ForceInterval get_interval() const noexcept { return {begin, calc_end()}; }
  /// Weights of the rows of its triangle for a unit impulse along an axis.
  void find_weights(int direction, float* weight) const noexcept;
};

/// Moments of a force along each of its axes.
using ForceMoments = std::array<Moments, 3>;

/// Over one interval, the unit of time; the first step begins at `begin`, steps have the length `step`.
ForceMoments calc_force_moments(const QueuedForce& force, double begin, double step) noexcept;

/// Numbers of strikes.
struct StrikeCounters {
  std::int64_t accepted = 0;  // accepted strikes
  std::int64_t refused = 0;   // not finite, outside the surface, or queue full
  std::int64_t late = 0;      // began before the horizon and were moved to it
};

/// Invariant: every strike is finite, acts on a triangle of the model and had not begun at the horizon when queued. Allocates in the
/// constructor only. One thread at a time; only the constructor throws.
class StrikeQueue {
 public:
  /// The model must outlive the queue.
  StrikeQueue(const Model& model, int max_pulses, int max_forces);

  /// Queues a strike. `horizon`: first sample still to be rendered; earlier begins are moved to it. False if refused.
  bool push(const events::Impulse& impulse, std::int64_t horizon) noexcept;
  bool push(const events::Force& force, std::int64_t horizon) noexcept;

  /// Takes over the strikes and counters of the queue of another model. Strikes on missing triangles are refused.
  void take_over(const StrikeQueue& other) noexcept;

  std::span<const QueuedPulse> get_pulses() const noexcept { return pulses_; }
  std::span<const QueuedForce> get_forces() const noexcept { return forces_; }
  bool is_empty() const noexcept { return pulses_.empty() && forces_.empty(); }
  /// True if a strike acts in `count` samples from `sample` on.
  bool acts(std::int64_t sample, int count) const noexcept;
  /// Removes the strikes that end before a sample.
  void finish(std::int64_t sample) noexcept;
  void clear() noexcept;

  const StrikeCounters& get_counters() const noexcept { return counters_; }

 private:
  /// A force that was moved to the horizon, and may continue.
  struct LateForce {
    std::int32_t triangle = -1;
    double end = 0.0;    // as given, in samples
    double shift = 0.0;  // samples
  };

  void begin_in_time(double& begin, std::int64_t horizon) noexcept;
  void begin_in_time(QueuedForce& force, bool continues, std::int64_t horizon) noexcept;

  const Model* model_;
  std::vector<QueuedPulse> pulses_;  // capacity max_pulses, never grown
  std::vector<QueuedForce> forces_;  // capacity max_forces, never grown
  StrikeCounters counters_;
  std::array<LateForce, 8> late_{};  // the last ones; impacts at several places may take turns
  std::size_t oldest_late_ = 0;
};

}  // namespace carillon::synth

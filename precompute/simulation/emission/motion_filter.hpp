// From the steps of a simulation to places and velocities of vertices at the audio rate. Internal to carillon::emission.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/simulation/emission/rows.hpp"
#include "precompute/simulation/emission/surfaces.hpp"
#include "precompute/simulation/emission/weights.hpp"

namespace carillon::emission {

/// Half-sample j lies at the time of sample j / 2; it is a weighted mean of the steps (or means of a box of steps) within two half-samples.
/// Invariant: the sum and the first moment of the weights of a half-sample are 1 and 0, so that uniform motion passes exactly even
/// where the rate of the steps changes. Before the first step and behind the last one all vertices move uniformly.
class MotionFilter {
 public:
  static constexpr int kBefore = kDerivativeHalf + kPoleSpan / 2;  // samples of uniform motion before the first step
  static constexpr int kAhead = kMotionHalf / 2;                   // samples by which steps are ahead of places and velocities

  /// take(k): places and velocities of samples k to k + kBatch - 1 are there; k begins at -kBefore.
  MotionFilter(const Surfaces& surfaces, std::uint64_t frames, std::function<void(std::int64_t)> take);

  /// From the next step on, the first of a sample. steps: a multiple of 4.
  void set_rate(int steps_per_sample);
  /// u: (N, 4) displacements of the nodes of the caller [m].
  void add_step(const double* u);
  /// True behind the second step, or box of steps.
  bool has_speed() const { return values_seen_ == 2; }
  /// Uniform motion behind the last step until is_done().
  void finish(const std::function<bool()>& is_done);

  /// (rows) at sample k, which is one of the last kKept.
  const double* get_places(std::int64_t k) const { return places_[find_kept(k)].get(); }
  /// (rows) [m a sample] at sample k of the last kBatch.
  const double* get_velocities(std::int64_t k) const { return velocities_[find_kept(k) % kBatch].get(); }

  template <typename Visit>
  void visit_state(Visit&& visit) {
    visit(half_, value_, in_box_, values_seen_, next_, change_, last_at_, open_sum_, open_moment_, sum_, open_, last_, slope_,
          ring_.get_blocks());
    for (Rows& one : places_) visit(one.get_blocks());
  }

 private:
  static constexpr std::size_t kKept = kBefore + kBatch;
  static std::size_t find_kept(std::int64_t k) { return static_cast<std::size_t>(k + static_cast<std::int64_t>(kKept)) % kKept; }

  double find_time() const { return static_cast<double>(half_) + (value_ + shift_) / values_; }
  void keep(const double* u);
  void begin();
  void push_uniform(std::int64_t j);
  void feed_uniform(std::int64_t count);
  void feed(const double* u);
  void close_half();
  void push(std::int64_t j);

  const Surfaces& surfaces_;
  const RowLoops* loops_ = &find_loops();
  MotionWeights weights_ = make_motion_weights();
  std::uint64_t frames_;
  std::function<void(std::int64_t)> take_;

  // Of the rate.
  int box_ = 1, values_ = 0;                          // steps; values a half-sample
  double shift_ = 0.0;                                // of a value behind the first step of its box, in values
  std::vector<std::array<double, kEntry>> weight_;    // (values): of half-samples j - 1 to j + 2
  std::vector<std::array<double, kEntry>> distance_;  // in time, times the weight

  // State.
  std::int64_t half_ = 0;  // between half-samples half_ and half_ + 1
  int value_ = 0;          // of this half-sample
  int in_box_ = 0;
  std::int32_t values_seen_ = 0;                           // up to 2
  std::int64_t next_ = -kBefore;                           // sample of the next batch
  std::array<double, 3> change_{1.0, 1.0, 1.0};            // factors of the weights of the next values
  double last_at_ = 0.0;                                   // half-samples
  std::array<double, kEntry> open_sum_{}, open_moment_{};  // of the weights of half-sample j, at j mod kEntry
  std::vector<double> sum_;                                // (V, 4): of the steps in the box
  std::vector<double> open_;                               // (V, kEntry, 4): of the values
  std::vector<double> last_, slope_;                       // (V, 4): the last value [m] and its change a half-sample
  Ring ring_;                                              // half-samples
  std::array<Rows, kKept> places_;                         // m
  std::array<Rows, kBatch> velocities_;                    // m a sample
};

}  // namespace carillon::emission

// Simulation steps to positions and velocities of vertices at the audio rate. Internal to carillon::emission.
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

/// Half-sample j is at the time of sample j / 2: a weighted mean of the steps (or box means) within two half-samples. Invariant: the
/// weights of a half-sample have sum 1 and first moment 0, so that uniform motion passes exactly, also across rate changes. Before the
/// first and after the last step all vertices move uniformly.
class MotionFilter {
 public:
  static constexpr int kBefore = kDerivativeHalf + kPoleSpan / 2;  // samples of uniform motion before the first step
  static constexpr int kAhead = kMotionHalf / 2;                   // lead of the steps over positions and velocities, in samples

  /// take(k): receives positions and velocities of samples k to k + kBatch - 1; k begins at -kBefore.
  MotionFilter(const Surfaces& surfaces, std::uint64_t frames, std::function<void(std::int64_t)> take);

  /// Rate from the next step on, the first of a sample. steps: a multiple of 4.
  void set_rate(int steps_per_sample);
  /// u: (N, 4) displacements of the caller's nodes [m].
  void add_step(const double* u);
  /// True after the second step, or box of steps.
  bool has_speed() const { return values_seen_ == 2; }
  /// Continues uniform motion after the last step until is_done().
  void finish(const std::function<bool()>& is_done);

  /// (rows) at sample k, one of the last kKept.
  const double* get_places(std::int64_t k) const { return places_[find_kept(k)].get(); }
  /// (rows) [m per sample] at sample k, one of the last kBatch.
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

  // Rate-dependent.
  int box_ = 1, values_ = 0;                          // steps; values per half-sample
  double shift_ = 0.0;                                // offset of a value from the first step of its box, in values
  std::vector<std::array<double, kEntry>> weight_;    // (values): for half-samples j - 1 to j + 2
  std::vector<std::array<double, kEntry>> distance_;  // time distance times the weight

  // State.
  std::int64_t half_ = 0;  // between half-samples half_ and half_ + 1
  int value_ = 0;          // in this half-sample
  int in_box_ = 0;
  std::int32_t values_seen_ = 0;                           // up to 2
  std::int64_t next_ = -kBefore;                           // first sample of the next batch
  std::array<double, 3> change_{1.0, 1.0, 1.0};            // weight factors of the next values
  double last_at_ = 0.0;                                   // half-samples
  std::array<double, kEntry> open_sum_{}, open_moment_{};  // of half-sample j's weights, at j mod kEntry
  std::vector<double> sum_;                                // (V, 4): of the steps in the box
  std::vector<double> open_;                               // (V, kEntry, 4): of the values
  std::vector<double> last_, slope_;                       // (V, 4): last value [m] and its change per half-sample
  Ring ring_;                                              // half-samples
  std::array<Rows, kKept> places_;                         // m
  std::array<Rows, kBatch> velocities_;                    // m per sample
};

}  // namespace carillon::emission

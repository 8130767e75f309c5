// Method: a step is added to the four half-samples around it (polyphase, no step history); positions and velocities are weighted sums of
//   half-samples, which also compensate the droop of the first stage. Many steps per sample are first averaged in boxes. A velocity is the
//   difference of two steps, so its images at multiples of the box rate are attenuated twice. docs/equations.md E14.
#include "precompute/simulation/emission/motion_filter.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace carillon::emission {
namespace {

constexpr int kMinBoxesPerSample = 16;                         // boxes per sample: images at -60 dB
constexpr int kSpan = 2 * (kBatch - 1) + 2 * kMotionHalf + 1;  // half-samples of a batch
constexpr std::int64_t kSlot = kEntry - 1;                     // mask for half-sample numbers

/// Steps per box.
int find_box(int steps) {
  for (int box = steps / kMinBoxesPerSample; box > 1; --box)
    if (steps / 2 % box == 0) return box;
  return 1;
}

/// Weight factors of the first three values after a rate change, for a third-order (Euler-Maclaurin) integral. ratio: old spacing over the
/// new one; end, begin: distances of the last and first value from the change.
std::array<double, 3> join(double ratio, double end, double begin) {
  const auto b1 = [](double x) { return x - 0.5; };
  const auto b2 = [](double x) { return x * x - x + 1.0 / 6.0; };
  const auto b3 = [](double x) { return x * (x - 0.5) * (x - 1.0); };
  const double value = b1(begin) + ratio * b1(end), slope = 0.5 * (b2(begin) - ratio * ratio * b2(end)),
               bend = (b3(begin) + ratio * ratio * ratio * b3(end)) / 6.0;
  const double x = begin, y = begin + 1.0,
               z = begin + 2.0;  // value, slope and curvature at the change of the parabola through three values
  return {1.0 + 0.5 * y * z * value - 0.5 * (y + z) * slope + bend, 1.0 - x * z * value + (x + z) * slope - 2.0 * bend,
          1.0 + 0.5 * x * y * value - 0.5 * (x + y) * slope + bend};
}

}  // namespace

MotionFilter::MotionFilter(const Surfaces& surfaces, std::uint64_t frames, std::function<void(std::int64_t)> take)
    : surfaces_(surfaces),
      frames_(frames),
      take_(std::move(take)),
      sum_(4 * surfaces.node.size(), 0.0),
      open_(kEntry * sum_.size(), 0.0),
      last_(sum_),
      slope_(sum_),
      ring_(surfaces.get_rows(), kSpan + 1) {
  places_.fill(Rows(surfaces.get_rows()));
  velocities_.fill(Rows(surfaces.get_rows()));
}

void MotionFilter::set_rate(int steps_per_sample) {
  const double before = values_ > 0 ? 1.0 / values_ : 0.0, end = 1.0 - shift_;  // half-samples between values; remainder after the last
  box_ = find_box(steps_per_sample);
  values_ = steps_per_sample / 2 / box_;
  shift_ = 0.5 * (box_ - 1) / box_;
  if (has_speed()) change_ = join(before * values_, end, shift_);
  // Common to all values of a half-sample: removes the first moment left by the shift.
  weight_.assign(values_, {});
  distance_ = weight_;
  double sum = 0.0, moment = 0.0, square = 0.0;
  for (int pass = 0; pass < 2; ++pass)
    for (int i = 0; i < values_; ++i)
      for (int s = 0; s < kEntry; ++s) {
        const double x = (i + shift_) / values_ + 1 - s, first = calc_entry(x);
        const double weight = pass == 0 ? first : first * (square - moment * x) / (sum * square - moment * moment);
        weight_[i][s] = weight;
        distance_[i][s] = weight * x;
        if (pass > 0) continue;
        sum += first;
        moment += first * x;
        square += first * x * x;
      }
}

void MotionFilter::add_step(const double* u) {
  const bool is_first = in_box_ == 0;
  if (++in_box_ < box_) return loops_->add_places(sum_.data(), u, surfaces_.node.data(), surfaces_.node.size(), is_first);
  in_box_ = 0;
  // The first two values define the motion before them, the last two the motion after them.
  if (values_seen_ < 2 || half_ + 4 >= 2 * static_cast<std::int64_t>(frames_)) keep(u);
  if (values_seen_ == 2) {
    feed(u);
  } else if (++values_seen_ == 2) {
    begin();
  } else {
    ++value_;
  }
}

/// Processes a box whose last step is u.
void MotionFilter::keep(const double* u) {
  const double now = find_time(), per_time = values_seen_ > 0 ? 1.0 / (now - last_at_) : 0.0;
  for (std::size_t v = 0; v < surfaces_.node.size(); ++v)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t at = 4 * v + axis;
      const double value = ((box_ > 1 ? sum_[at] : 0.0) + u[4 * surfaces_.node[v] + axis]) / box_;
      slope_[at] = per_time * (value - last_[at]);
      last_[at] = value;
    }
  last_at_ = now;
}

/// Next value of uniform motion.
void MotionFilter::feed_uniform(std::int64_t count) {
  for (std::int64_t n = 0; n < count; ++n) {
    const double time = find_time() - last_at_;
    for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] = box_ * (last_[i] + time * slope_[i]);
    feed(nullptr);
  }
}

/// Half-sample j of uniform motion.
void MotionFilter::push_uniform(std::int64_t j) {
  const double time = static_cast<double>(j) - last_at_;
  for (std::size_t v = 0; v < surfaces_.row.size(); ++v) {
    const std::size_t row = surfaces_.row[v];
    double* to = ring_.get(row, j).data + row % kLane;
    for (std::size_t axis = 0; axis < 3; ++axis) to[axis] = last_[4 * v + axis] + time * slope_[4 * v + axis];
  }
  push(j);
}

/// All half-samples before the first step, and the first two values.
void MotionFilter::begin() {
  for (std::int64_t j = -2 * (kBefore + kAhead); j < -kEntry; ++j) push_uniform(j);
  const std::int64_t count = (half_ + kEntry - 1) * values_ + value_ + 1;
  half_ = 1 - kEntry;
  value_ = 0;
  feed_uniform(count);
}

/// Processes a box: sum_, and its last step u.
void MotionFilter::feed(const double* u) {
  const auto& weight = weight_[value_];
  const auto& distance = distance_[value_];
  std::array<double, kEntry> by_slot;
  for (std::size_t s = 0; s < kEntry; ++s) {
    const std::size_t slot = (half_ - 1 + static_cast<std::int64_t>(s)) & kSlot;
    by_slot[slot] = change_[0] * weight[s] / box_;
    open_sum_[slot] += change_[0] * weight[s];
    open_moment_[slot] += change_[0] * distance[s];
  }
  change_ = {change_[1], change_[2], 1.0};
  loops_->add_value(open_.data(), u && box_ == 1 ? nullptr : sum_.data(), u, u ? surfaces_.node.data() : nullptr, surfaces_.node.size(),
                    by_slot.data());
  if (++value_ == values_) close_half();
}

void MotionFilter::close_half() {
  const std::int64_t j = half_ - 1;
  const std::size_t slot = j & kSlot;
  const double scale = 1.0 / open_sum_[slot], shift = open_moment_[slot] * scale;  // in half-samples
  loops_->close_value(open_.data(), surfaces_.node.size(), static_cast<int>(slot), scale, ring_.get(0, j));
  if (std::abs(shift) > 1e-9) {
    // A value at time t of uniform motion is x + (t - now) speed, and the speed is (x - last) / (1 + shift).
    for (std::size_t begin = 0; begin < surfaces_.get_rows(); begin += kLane) {
      double* now = ring_.get(begin, j).data;
      const double* last = ring_.get(begin, j - 1).data;
      for (std::size_t i = 0; i < kLane; ++i) now[i] -= shift / (1.0 + shift) * (now[i] - last[i]);
    }
  }
  open_sum_[slot] = open_moment_[slot] = 0.0;
  value_ = 0;
  ++half_;
  push(j);
}

/// Handles the completed half-sample j.
void MotionFilter::push(std::int64_t j) {
  if (j != 2 * (next_ + kBatch - 1 + kAhead)) return;
  std::array<std::size_t, kSpan> offset;
  for (std::size_t i = 0; i < offset.size(); ++i) offset[i] = ring_.find_offset(2 * (next_ - kAhead) + static_cast<std::int64_t>(i));
  double *x[kBatch], *v[kBatch];
  for (int b = 0; b < kBatch; ++b) {
    x[b] = places_[find_kept(next_ + b)].get();
    v[b] = velocities_[find_kept(next_ + b) % kBatch].get();
  }
  loops_->calc_motion(ring_.get(), offset.data(), surfaces_.get_rows(), weights_.even.data(), weights_.odd.data(), surfaces_.rest.get(), x,
                      v);
  next_ += kBatch;
  take_(next_ - kBatch);
}

void MotionFilter::finish(const std::function<bool()>& is_done) {
  in_box_ = 0;
  feed_uniform((kEntry + 1) * values_ - value_);
  for (; !is_done(); ++half_) push_uniform(half_ - 1);
}

}  // namespace carillon::emission

#include "runtime/synth/strike_queue.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/vector.hpp"

namespace carillon::synth {
namespace {

// Relative size below which a direction of a force's steps is rounding of single precision.
constexpr double kParallel = 3e-7;

using Steps = std::array<Vec3, events::kMaxForceSteps>;

bool is_finite(const Vec3& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }
Vec3 widen(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }
Vec3 subtract(const Vec3& a, double s, const Vec3& b) { return {a[0] - s * b[0], a[1] - s * b[1], a[2] - s * b[2]}; }

bool is_playable(const events::Impulse& impulse, const Model& model) {
  return std::isfinite(impulse.time_s) && std::isfinite(impulse.duration_s) && impulse.duration_s >= 0.0 &&
         is_finite(impulse.barycentric) && is_finite(impulse.impulse_n_s) && model.has_triangle(impulse.triangle);
}

bool is_playable(const events::Force& force, const Model& model) {
  bool sane = std::isfinite(force.time_s) && std::isfinite(force.step_s) && force.step_s > 0.0 && force.count >= 1 &&
              force.count <= events::kMaxForceSteps && is_finite(force.barycentric) && model.has_triangle(force.triangle);
  for (std::size_t k = 0; sane && k < static_cast<std::size_t>(force.count); ++k) sane = is_finite(widen(force.impulse_n_s[k]));
  return sane;
}

/// Decomposes the steps along axes, each that of the largest remaining step.
void find_directions(Steps left, QueuedForce& force) {
  const std::size_t count = force.count;
  double largest = 0.0;
  for (; force.axes < 3; ++force.axes) {
    const auto max =
        std::max_element(left.begin(), left.begin() + force.count, [](const auto& a, const auto& b) { return dot(a, a) < dot(b, b); });
    const double size = std::sqrt(dot(*max, *max));
    if (force.axes == 0) largest = size;
    if (!(size > kParallel * largest)) break;
    const Vec3 unit{(*max)[0] / size, (*max)[1] / size, (*max)[2] / size};
    for (std::size_t axis = 0; axis < 3; ++axis) force.axis[force.axes][axis] = static_cast<float>(unit[axis]);
    for (std::size_t k = 0; k < count; ++k) {
      const double along = dot(left[k], unit);
      force.along[force.axes][k] = static_cast<float>(along);
      left[k] = subtract(left[k], along, unit);
    }
  }
}

}  // namespace

void QueuedForce::find_weights(int direction, float* weight) const noexcept {
  for (int corner = 0; corner < 3; ++corner) {
    for (int k = 0; k < 3; ++k) weight[corner * 3 + k] = barycentric[corner] * axis[direction][k];
  }
}

ForceMoments calc_force_moments(const QueuedForce& force, double begin, double step) noexcept {
  ForceMoments sum{};
  const int first = static_cast<int>(std::clamp(std::floor(-begin / step), 0.0, static_cast<double>(force.count)));
  for (int k = first; k < force.count && begin + k * step < 1.0; ++k) {
    const Moments moments = calc_level_moments(begin + k * step, step);
    for (int axis = 0; axis < force.axes; ++axis) {
      const double along = force.along[axis][k];
      for (int j = 0; j < kMoments; ++j) sum[axis][j] += along * moments[j];
    }
  }
  return sum;
}

StrikeQueue::StrikeQueue(const Model& model, int max_pulses, int max_forces) : model_(&model) {
  pulses_.reserve(std::max(1, max_pulses));
  forces_.reserve(std::max(0, max_forces));
}

/// Forces after the sample before the horizon are still audible.
void StrikeQueue::begin_in_time(double& begin, std::int64_t horizon) noexcept {
  const double earliest = static_cast<double>(horizon - 1);
  if (begin > earliest) return;
  begin = std::nextafter(earliest, earliest + 1.0);
  ++counters_.late;
}

/// Pieces of one late pulse are shifted together: at the horizon they would act at once.
void StrikeQueue::begin_in_time(QueuedForce& force, bool continues, std::int64_t horizon) noexcept {
  constexpr double kSame = 1e-2;  // samples
  const double begin = force.begin, end = force.calc_end();
  const auto before = std::find_if(late_.begin(), late_.end(), [&](const LateForce& late) {
    return continues && late.triangle == force.triangle && std::abs(late.end - begin) < kSame;
  });
  if (before != late_.end()) force.begin += before->shift;
  if (before == late_.end() || force.begin <= static_cast<double>(horizon - 1)) begin_in_time(force.begin, horizon);
  if (!(force.begin > begin)) return;
  LateForce& late = before != late_.end() ? *before : late_[oldest_late_];
  if (before == late_.end()) oldest_late_ = (oldest_late_ + 1) % late_.size();
  late = {force.triangle, end, force.begin - begin};
}

bool StrikeQueue::push(const events::Impulse& impulse, std::int64_t horizon) noexcept {
  if (!is_playable(impulse, *model_) || pulses_.size() == pulses_.capacity()) {
    ++counters_.refused;
    return false;
  }
  QueuedPulse pulse;
  pulse.shape = impulse.shape;
  pulse.length = calc_pulse_length(impulse.shape, impulse.duration_s * model_->get_rate_hz());
  pulse.begin = impulse.time_s * model_->get_rate_hz() - 0.5 * pulse.length;
  begin_in_time(pulse.begin, horizon);
  pulse.strength_n_s = static_cast<float>(calc_length(impulse.impulse_n_s));
  pulse.triangle = impulse.triangle;
  for (int corner = 0; corner < 3; ++corner) {
    for (int axis = 0; axis < 3; ++axis) {
      pulse.weight[corner * 3 + axis] = static_cast<float>(impulse.barycentric[corner] * impulse.impulse_n_s[axis]);
    }
  }
  model_->find_rows(pulse.triangle, pulse.row);
  pulses_.push_back(pulse);
  ++counters_.accepted;
  return true;
}

bool StrikeQueue::push(const events::Force& force, std::int64_t horizon) noexcept {
  if (!is_playable(force, *model_) || forces_.size() == forces_.capacity()) {
    ++counters_.refused;
    return false;
  }
  QueuedForce queued{};
  queued.begin = force.time_s * model_->get_rate_hz();
  queued.step = std::max(force.step_s * model_->get_rate_hz(), kShortestStep);
  queued.triangle = force.triangle;
  queued.count = force.count;
  begin_in_time(queued, force.continues, horizon);
  for (std::size_t corner = 0; corner < 3; ++corner) queued.barycentric[corner] = static_cast<float>(force.barycentric[corner]);
  Steps steps{};
  double strength = 0.0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(force.count); ++k) {
    steps[k] = widen(force.impulse_n_s[k]);
    strength += std::sqrt(dot(steps[k], steps[k]));
  }
  queued.strength_n_s = static_cast<float>(strength);
  find_directions(steps, queued);
  if (queued.axes > 0) forces_.push_back(queued);
  ++counters_.accepted;
  return true;
}

void StrikeQueue::take_over(const StrikeQueue& other) noexcept {
  counters_ = other.counters_;
  late_ = other.late_;
  oldest_late_ = other.oldest_late_;
  clear();
  for (const QueuedPulse& pulse : other.pulses_) {
    if (pulses_.size() == pulses_.capacity() || !model_->has_triangle(pulse.triangle)) {
      ++counters_.refused;
      continue;
    }
    pulses_.push_back(pulse);
    model_->find_rows(pulses_.back().triangle, pulses_.back().row);
  }
  for (const QueuedForce& force : other.forces_) {
    if (forces_.size() == forces_.capacity() || !model_->has_triangle(force.triangle))
      ++counters_.refused;
    else
      forces_.push_back(force);
  }
}

bool StrikeQueue::acts(std::int64_t sample, int count) const noexcept {
  const auto overlaps = [=](const auto& strike) { return strike.get_interval().overlaps(sample, count); };
  return std::any_of(pulses_.begin(), pulses_.end(), overlaps) || std::any_of(forces_.begin(), forces_.end(), overlaps);
}

void StrikeQueue::finish(std::int64_t sample) noexcept {
  const auto last = static_cast<double>(sample - 1);
  std::erase_if(pulses_, [last](const QueuedPulse& pulse) { return pulse.get_interval().end <= last; });
  std::erase_if(forces_, [last](const QueuedForce& force) { return force.get_interval().end <= last; });
}

void StrikeQueue::clear() noexcept {
  pulses_.clear();
  forces_.clear();
}

}  // namespace carillon::synth

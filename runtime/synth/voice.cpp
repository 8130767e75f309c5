// One body's sound: all that acts on its modes acts on one state; longer than most files.
// Method:     the modes ring by kernels.hpp, period by period. A strike is worked out as the answer of modes at rest, over the quanta that
//             its pulse touches, and added to what rings: the modes are linear. Modes near and above critical damping are few and die at
//             once; they go sample by sample in double precision. Groups of modes that cannot be heard any more are dropped from the
//             end of the list, every eighth period.
// Source:     OSG02 section 4 (impulses to modes), corrected by its missing factor 1/2 in eq. 16-18; docs/equations.md E4 and E5.
// Deviations: none.
#include "runtime/synth/voice.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "runtime/bank/air.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/synth/fp_guard.hpp"

namespace carillon::synth {
namespace {

/// Whether this build has any effect of contacts that last.
constexpr bool kHasContacts = kCompiledEffects.has_any(kContactEffects);
constexpr std::int64_t kCullEvery = 8;  // periods

bool is_finite(const Vec3& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }
Vec3 widen(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }
Vec3 subtract(const Vec3& a, double s, const Vec3& b) { return {a[0] - s * b[0], a[1] - s * b[1], a[2] - s * b[2]}; }

// A direction that the samples of a force have no more of than this share of the largest is rounding of single precision.
constexpr double kParallel = 3e-7;

}  // namespace

double calc_radiated_share(double gain, double decay_per_s) noexcept {
  const double radiation_per_s = bank::calc_radiation_decay(gain);
  return radiation_per_s < decay_per_s ? radiation_per_s / decay_per_s : 1.0;
}

Voice::Voice(std::shared_ptr<const Model> model, VoiceOptions options)
    : model_(std::move(model)), kernels_(&get_kernels(options.isa)), silence_pa_(options.silence_pa), audits_(options.audits_energy) {
  if (!(silence_pa_ > 0.0) || !std::isfinite(silence_pa_)) throw InputError("the pressure of silence must be a positive number of Pa");
  groups_ = static_cast<int>(model_->sound_.size());
  limit_ = cut_ = driven_ = groups_;
  state_.resize(model_->sound_.size());
  starts_.resize(model_->sound_.size());
  damped_.resize(model_->damped_.size());
  bounds_.resize(model_->sound_.size());
  damped_amplitude_.resize(model_->damped_.size());
  pulses_.reserve(static_cast<std::size_t>(std::max(1, options.max_strikes)));
  forces_.reserve(static_cast<std::size_t>(std::max(0, options.max_forces)));
  if (!audits_) return;
  radiation_.resize(static_cast<std::size_t>(model_->ringing_));
  for (std::size_t m = 0; m < radiation_.size(); ++m) {
    const Model::Mode& mode = model_->modes_[m];
    radiation_[m].part = calc_radiated_share(mode.gain, mode.decay) * -std::expm1(-2.0 * mode.decay * kPeriod / model_->rate_hz_);
  }
}

bool Voice::strike(const stream::Impulse& impulse) noexcept {
  const bool sane = std::isfinite(impulse.time_s) && std::isfinite(impulse.duration_s) && impulse.duration_s >= 0.0 &&
                    is_finite(impulse.barycentric) && is_finite(impulse.impulse_n_s) && impulse.triangle >= 0 &&
                    static_cast<std::size_t>(impulse.triangle) < model_->triangles_.size();
  if (!sane || pulses_.size() == pulses_.capacity()) {
    ++counters_.refused;
    return false;
  }
  Pulse pulse;
  pulse.shape = impulse.shape;
  pulse.length = calc_pulse_length(impulse.shape, impulse.duration_s * model_->rate_hz_);
  pulse.begin = impulse.time_s * model_->rate_hz_ - 0.5 * pulse.length;
  begin_in_time(pulse.begin);
  pulse.strength_n_s = static_cast<float>(std::hypot(impulse.impulse_n_s[0], impulse.impulse_n_s[1], impulse.impulse_n_s[2]));
  pulse.triangle = impulse.triangle;
  for (int corner = 0; corner < 3; ++corner) {
    for (int axis = 0; axis < 3; ++axis) {
      pulse.weight[corner * 3 + axis] = static_cast<float>(impulse.barycentric[corner] * impulse.impulse_n_s[axis]);
    }
  }
  find_rows(pulse.triangle, pulse.row);
  pulses_.push_back(pulse);
  ++counters_.accepted;
  return true;
}

/// The sample at the horizon is still to come: what happens after the one before it can still be heard. What is earlier moves there.
void Voice::begin_in_time(double& begin) noexcept {
  const double earliest = static_cast<double>(horizon_ - 1);
  if (begin > earliest) return;
  begin = std::nextafter(earliest, earliest + 1.0);
  ++counters_.late;
}

bool Voice::push(const stream::Force& force) noexcept {
  bool sane = std::isfinite(force.time_s) && std::isfinite(force.step_s) && force.step_s > 0.0 && force.count >= 1 &&
              force.count <= stream::kMostForceSteps && is_finite(force.barycentric) && force.triangle >= 0 &&
              static_cast<std::size_t>(force.triangle) < model_->triangles_.size();
  for (std::size_t k = 0; sane && k < static_cast<std::size_t>(force.count); ++k) sane = is_finite(widen(force.impulse_n_s[k]));
  if (!sane || forces_.size() == forces_.capacity()) {
    ++counters_.refused;
    return false;
  }
  Steps steps{};
  steps.begin = force.time_s * model_->rate_hz_;
  steps.step = std::max(force.step_s * model_->rate_hz_, kShortestStep);
  begin_in_time(steps.begin);
  steps.triangle = force.triangle;
  steps.count = force.count;
  for (std::size_t corner = 0; corner < 3; ++corner) steps.barycentric[corner] = static_cast<float>(force.barycentric[corner]);
  // Directions one by one, each that of the largest sample of what is left.
  std::array<Vec3, stream::kMostForceSteps> left{};
  const auto count = static_cast<std::size_t>(force.count);
  double strength = 0.0, largest = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    left[k] = widen(force.impulse_n_s[k]);
    strength += std::sqrt(dot(left[k], left[k]));
  }
  steps.strength_n_s = static_cast<float>(strength);
  for (; steps.axes < 3; ++steps.axes) {
    const auto most =
        std::max_element(left.begin(), left.begin() + force.count, [](const auto& a, const auto& b) { return dot(a, a) < dot(b, b); });
    const double size = std::sqrt(dot(*most, *most));
    if (steps.axes == 0) largest = size;
    if (!(size > kParallel * largest)) break;
    const Vec3 unit{(*most)[0] / size, (*most)[1] / size, (*most)[2] / size};
    for (std::size_t axis = 0; axis < 3; ++axis) steps.axis[steps.axes][axis] = static_cast<float>(unit[axis]);
    for (std::size_t k = 0; k < count; ++k) {
      const double along = dot(left[k], unit);
      steps.along[steps.axes][k] = static_cast<float>(along);
      left[k] = subtract(left[k], along, unit);
    }
  }
  if (steps.axes > 0) forces_.push_back(steps);
  ++counters_.accepted;
  return true;
}

void Voice::find_rows(std::int32_t triangle, const std::int16_t** row) const noexcept {
  const auto& corners = model_->triangles_[static_cast<std::size_t>(triangle)];
  for (int corner = 0; corner < 3; ++corner) {
    for (int axis = 0; axis < 3; ++axis) row[corner * 3 + axis] = model_->get_row(corners[corner], axis);
  }
}

/// Rows and weights of touch_ for a unit impulse along one direction of a force.
void Voice::find_touch(const Steps& steps, int axis) noexcept {
  find_rows(steps.triangle, touch_.row);
  for (int corner = 0; corner < 3; ++corner) {
    for (int k = 0; k < 3; ++k) touch_.weight[corner * 3 + k] = steps.barycentric[corner] * steps.axis[axis][k];
  }
}

/// The moments of a force over one interval, in which its first step begins at `begin` and steps have the length `step`.
Voice::StepMoments Voice::calc_moments(const Steps& steps, double begin, double step) {
  StepMoments sum{};
  const int first = static_cast<int>(std::clamp(std::floor(-begin / step), 0.0, static_cast<double>(steps.count)));
  for (int k = first; k < steps.count && begin + k * step < 1.0; ++k) {
    const Moments moments = calc_level_moments(begin + k * step, step);
    for (int axis = 0; axis < steps.axes; ++axis) {
      const double along = steps.along[axis][k];
      for (int j = 0; j < kMoments; ++j) sum[axis][j] += along * moments[j];
    }
  }
  return sum;
}

void Voice::process(std::span<float> pressure_pa) noexcept {
  const FpGuard guard;
  while (!pressure_pa.empty()) {
    if (held_ == 0) {
      const auto left = static_cast<int>((kPeriod - horizon_ % kPeriod) / kQuantum);
      const std::size_t wanted = std::max<std::size_t>(1, pressure_pa.size() / kQuantum);
      render(static_cast<int>(std::min(static_cast<std::size_t>(left), wanted)));
    }
    const std::size_t count = std::min(static_cast<std::size_t>(held_), pressure_pa.size());
    if (!silent_) {
      const float* from = block_.data() + (rendered_ - held_);
      for (std::size_t n = 0; n < count; ++n) pressure_pa[n] += from[n];
    }
    held_ -= static_cast<int>(count);
    pressure_pa = pressure_pa.subspan(count);
  }
}

/// Fills block_ with the next `quanta` quanta, all of one period.
void Voice::render(int quanta) noexcept {
  const auto first = static_cast<int>(horizon_ % kPeriod / kQuantum);
  const std::int64_t start = horizon_;
  horizon_ += quanta * kQuantum;
  rendered_ = held_ = quanta * kQuantum;
  if (first == 0) {
    if (audits_) audit();
    fading_ = std::exchange(inherits_, false);
    if (const int stay = std::min(limit_, cut_); stay < live_) fade_out(stay);
    cut_ = groups_;
    if (start / kPeriod % kCullEvery == 0 && is_awake()) cull();
  }
  silent_ =
      !is_awake() && !fading_ && pulses_.empty() && forces_.empty() && (!kHasContacts || contacts_ == nullptr || contacts_->is_resting());
  if (silent_) return;
  const bool touched = kHasContacts && contacts_ != nullptr && !contacts_->is_idle();
  std::fill(block_.begin(), block_.begin() + rendered_, 0.0F);
  bool struck_at_all = false;
  for (int q = 0; q < quanta; ++q) struck_at_all = struck_at_all || is_struck(start + q * kQuantum);
  undisturbed_ = undisturbed_ && !struck_at_all && !touched;
  const bool whole = quanta == kQuanta && !struck_at_all && !touched;
  if (live_ > 0 && whole) {
    kernels_->ring(model_->sound_.data(), model_->turn_.data(), state_.data(), live_, block_.data());
  } else if (live_ > 0 && first == 0) {
    kernels_->advance(model_->turn_.data(), state_.data(), starts_.data(), live_);
  }
  for (int q = 0, made = whole ? quanta : 0; q < quanta; ++q) {
    float* out = block_.data() + q * kQuantum;
    const std::int64_t sample = start + q * kQuantum;
    const bool struck = struck_at_all && is_struck(sample);
    const Drive* drive = touched ? contacts_->begin_quantum(sample) : nullptr;
    const bool driven = drive != nullptr && drive->forces, damped = drive != nullptr && drive->damps;
    if (driven) wake(std::min(find_reach(drive->strength_n_s), driven_));
    if (q == made) {  // what rings, up to the next quantum that is struck or touched: that changes the starts after it
      do ++made;
      while (made < quanta && !touched && !struck && !is_struck(start + made * kQuantum));
      if (live_ > 0 && !damped) kernels_->emit(model_->sound_.data(), starts_.data(), live_, first + q, made - q, out);
    }
    if (drive != nullptr && live_ > 0) {
      kernels_->drive(model_->strike_.data(), model_->turn_.data(), *drive, first + q, state_.data(), starts_.data(), live_, out);
      counters_.mode_samples += static_cast<std::int64_t>(live_) * kGroup * kQuantum;
    }
    if (struck) strike_quantum(sample, first + q, out);
    counters_.mode_samples += static_cast<std::int64_t>(live_) * kGroup * kQuantum;
    if (struck || driven || damped_live_) add_damped(sample, struck, driven, out);
    if (fading_) {
      for (int n = 0; n < kQuantum; ++n) out[n] += fade_[(first + q) * kQuantum + n];
    }
    int bad = 0;
    for (int n = 0; n < kQuantum; ++n) bad |= static_cast<int>(!(std::abs(out[n]) <= std::numeric_limits<float>::max()));
    if (bad != 0) {
      reset();
      std::fill(block_.begin() + q * kQuantum, block_.begin() + rendered_, 0.0F);
      break;
    }
  }
  const auto heard = static_cast<double>(horizon_ - 1);
  std::erase_if(pulses_, [heard](const Pulse& pulse) { return pulse.begin + pulse.length <= heard; });
  std::erase_if(forces_, [heard](const Steps& steps) { return steps.calc_end() <= heard; });
}

/// Whether a pulse acts in the quantum that begins at `sample`. The interval of sample n is (n - 1, n].
bool Voice::is_struck(std::int64_t sample) const noexcept {
  for (const Pulse& pulse : pulses_) {
    if (pulse.begin <= static_cast<double>(sample + kQuantum - 1) && pulse.begin + pulse.length > static_cast<double>(sample - 1)) {
      return true;
    }
  }
  for (const Steps& steps : forces_) {
    if (steps.begin <= static_cast<double>(sample + kQuantum - 1) && steps.calc_end() > static_cast<double>(sample - 1)) return true;
  }
  return false;
}

/// Makes as many groups live as the limit allows; the starts of those that were not are out of date.
void Voice::wake(int groups) noexcept {
  for (const int last = std::min(groups, limit_); live_ < last; ++live_) starts_[static_cast<std::size_t>(live_)] = Starts{};
}

/// Up to which group a strike can be heard above the floor.
int Voice::find_reach(float strength_n_s) const noexcept {
  if (!(floor_pa_ > 0.0F)) return groups_;
  const auto& reach = model_->reach_;
  const auto last = std::partition_point(reach.begin(), reach.end(), [&](float pa) { return pa * strength_n_s >= floor_pa_; });
  return std::max(1, static_cast<int>(last - reach.begin()));
}

void Voice::strike_quantum(std::int64_t sample, int quantum, float* out) noexcept {
  const auto find_begin = [sample](const Pulse& pulse) { return pulse.begin - static_cast<double>(sample - 1); };
  const auto acts = [&](const Pulse& pulse) { return find_begin(pulse) <= kQuantum && find_begin(pulse) + pulse.length > 0.0; };
  for (const Pulse& pulse : pulses_) {
    if (acts(pulse)) wake(find_reach(pulse.strength_n_s));
  }
  for (const Pulse& pulse : pulses_) {
    if (!acts(pulse)) continue;
    const double begin = find_begin(pulse);
    touch_.first = std::clamp(static_cast<int>(std::ceil(begin)) - 1, 0, kQuantum);
    touch_.last = std::clamp(static_cast<int>(std::ceil(begin + pulse.length)), touch_.first, kQuantum);
    for (int n = touch_.first; n < touch_.last; ++n) {
      const Moments moments = calc_pulse_moments(pulse.shape, begin - n, pulse.length);
      for (int j = 0; j < kTerms; ++j) touch_.moment[n][j] = static_cast<float>(moments[j]);
    }
    std::copy(std::begin(pulse.row), std::end(pulse.row), touch_.row);
    std::copy(std::begin(pulse.weight), std::end(pulse.weight), touch_.weight);
    kernels_->strike(model_->strike_.data(), model_->turn_.data(), touch_, quantum, state_.data(), starts_.data(), live_, out);
    counters_.mode_samples += static_cast<std::int64_t>(live_) * kGroup * kQuantum;
  }
  // Forces may be parts of one pulse, which only together lift a mode above the floor.
  float strength = 0.0F;
  for (const Steps& steps : forces_) strength += steps.strength_n_s;
  for (const Steps& steps : forces_) {
    if (steps.begin > static_cast<double>(sample - 1 + kQuantum) || steps.calc_end() <= static_cast<double>(sample - 1)) continue;
    wake(find_reach(strength));
    push_steps(steps, sample, quantum, out);
  }
}

/// What a force makes in one quantum: a pulse along each of its directions.
void Voice::push_steps(const Steps& steps, std::int64_t sample, int quantum, float* out) noexcept {
  const double begin = steps.begin - static_cast<double>(sample - 1), end = steps.calc_end() - static_cast<double>(sample - 1);
  touch_.first = std::clamp(static_cast<int>(std::ceil(begin)) - 1, 0, kQuantum);
  touch_.last = std::clamp(static_cast<int>(std::ceil(end)), touch_.first, kQuantum);
  std::array<StepMoments, kQuantum> moments;
  for (int n = touch_.first; n < touch_.last; ++n) moments[static_cast<std::size_t>(n)] = calc_moments(steps, begin - n, steps.step);
  for (int axis = 0; axis < steps.axes; ++axis) {
    find_touch(steps, axis);
    for (int n = touch_.first; n < touch_.last; ++n) {
      for (int j = 0; j < kTerms; ++j) touch_.moment[n][j] = static_cast<float>(moments[static_cast<std::size_t>(n)][axis][j]);
    }
    kernels_->strike(model_->strike_.data(), model_->turn_.data(), touch_, quantum, state_.data(), starts_.data(), live_, out);
    counters_.mode_samples += static_cast<std::int64_t>(live_) * kGroup * kQuantum;
  }
}

/// phi . impulse of one of the modes that do not ring [N s kg^-1/2].
double Voice::calc_amplitude(const std::int16_t* const* row, const float* weight, std::size_t mode) const noexcept {
  const std::size_t column = static_cast<std::size_t>(groups_) * kGroup + mode;
  double amplitude = 0.0;
  for (int r = 0; r < kStrikeRows; ++r) amplitude += static_cast<double>(weight[r]) * row[r][column];
  return amplitude * model_->damped_[mode].scale;
}

/// phi of one of them along the directions of a force.
std::array<double, 3> Voice::calc_amplitudes(const Steps& steps, std::size_t mode) const noexcept {
  const std::int16_t* row[kStrikeRows];
  float weight[kStrikeRows];
  find_rows(steps.triangle, row);
  std::array<double, 3> amplitudes{};
  for (int axis = 0; axis < steps.axes; ++axis) {
    for (int r = 0; r < kStrikeRows; ++r) weight[r] = steps.barycentric[r / 3] * steps.axis[axis][r % 3];
    amplitudes[static_cast<std::size_t>(axis)] = calc_amplitude(row, weight, mode);
  }
  return amplitudes;
}

/// A sample of a mode whose fast root f dies at once: with A the integral of the force times e^{-s age}, s the slow root, and B that of f
/// e^{-f age}, q = (A - B / f) / (f - s), q' = (B - s A) / (f - s). B is the force 1 / f before, up to its second derivative over f
/// squared. `n`: of the sample within the quantum that contacts drive, or -1.
void Voice::follow_force(std::size_t mode, std::int64_t sample, int n) noexcept {
  const auto& m = model_->damped_[mode];
  DampedState& state = damped_[mode];
  const double rate_hz = model_->rate_hz_, lag = rate_hz / m.fast;  // in samples
  double slow = (m.fast * state.q + state.v) * std::exp(-m.slow / rate_hz), fast = 0.0;
  if (n >= 0) {
    const float* force = contacts_->get_damped_force(mode) + n;
    const auto& ramp = contacts_->get_ramp();
    const auto begin = static_cast<double>(force[0]), end = static_cast<double>(force[1]);
    for (int j = 0; j < kMoments; ++j) slow += (begin * ramp[0][j] + end * ramp[1][j]) * m.force_q[j];
    fast += end - lag * (end - begin);
  }
  for (const Pulse& pulse : pulses_) {
    const double begin = pulse.begin - static_cast<double>(sample - 1);
    if (begin > 1.0 || begin + pulse.length <= 0.0) continue;
    const Moments moments = calc_pulse_moments(pulse.shape, begin, pulse.length);
    const double amplitude = calc_amplitude(pulse.row, pulse.weight, mode);
    for (int j = 0; j < kMoments; ++j) slow += amplitude * moments[j] * m.force_q[j];
    if (pulse.length > 2.0 * lag) fast += amplitude * calc_pulse(pulse.shape, (1.0 - lag - begin) / pulse.length) * rate_hz / pulse.length;
  }
  for (const Steps& steps : forces_) {
    const double begin = steps.begin - static_cast<double>(sample - 1);
    if (begin > 1.0 || steps.calc_end() <= static_cast<double>(sample - 1)) continue;
    const StepMoments moments = calc_moments(steps, begin, steps.step);
    const std::array<double, 3> amplitudes = calc_amplitudes(steps, mode);
    const double at = std::floor((1.0 - lag - begin) / steps.step);
    for (int axis = 0; axis < steps.axes; ++axis) {
      for (int j = 0; j < kMoments; ++j) slow += amplitudes[axis] * moments[axis][j] * m.force_q[j];
      if (at >= 0.0 && at < steps.count) fast += amplitudes[axis] * steps.along[axis][static_cast<int>(at)] * rate_hz / steps.step;
    }
  }
  const double width = m.fast - m.slow;
  state = {(slow - fast / m.fast) / width, (fast - m.slow * slow) / width};
}

void Voice::add_damped(std::int64_t sample, bool struck, bool driven, float* out) noexcept {
  const bool forced = struck || driven;
  const auto& modes = model_->damped_;
  damped_live_ = !modes.empty();
  for (std::size_t first = 0; first < modes.size();) {
    const int substeps = forced ? modes[first].substeps : 1;
    std::size_t last = first + 1;
    while (last < modes.size() && (!forced || modes[last].substeps == substeps)) ++last;
    for (int n = 0; n < kQuantum; ++n) {
      for (std::size_t i = first; forced && substeps == 0 && i < last; ++i) follow_force(i, sample + n, driven ? n : -1);
      for (int step = 0; forced && step < substeps; ++step) {
        for (std::size_t i = first; i < last; ++i) {
          const auto& m = modes[i];
          DampedState& s = damped_[i];
          s = {m.sub_qq * s.q + m.sub_qv * s.v, m.sub_vq * s.q + m.sub_vv * s.v};
        }
        for (std::size_t i = first; driven && i < last; ++i) {
          // From the sample before to this one, the force goes in a line.
          const auto& m = modes[i];
          const float* force = contacts_->get_damped_force(i) + n;
          const auto& ramp = contacts_->get_ramp();
          const double slope = (static_cast<double>(force[1]) - static_cast<double>(force[0])) / substeps;
          const double begin = static_cast<double>(force[0]) + slope * step;
          for (int j = 0; j < kMoments; ++j) {
            const double impulse = (begin * ramp[0][j] + (begin + slope) * ramp[1][j]) / substeps;
            damped_[i].q += impulse * m.force_q[j];
            damped_[i].v += impulse * m.force_v[j];
          }
        }
        for (const Pulse& pulse : pulses_) {
          const double begin = pulse.begin - static_cast<double>(sample - 1 + n);
          if (begin > 1.0 || begin + pulse.length <= 0.0) continue;
          const Moments moments = calc_pulse_moments(pulse.shape, begin * substeps - step, pulse.length * substeps);
          if (moments[0] == 0.0) continue;
          for (std::size_t i = first; i < last; ++i) {
            const auto& m = modes[i];
            const double amplitude = calc_amplitude(pulse.row, pulse.weight, i);
            for (int j = 0; j < kMoments; ++j) {
              damped_[i].q += amplitude * moments[j] * m.force_q[j];
              damped_[i].v += amplitude * moments[j] * m.force_v[j];
            }
          }
        }
        for (const Steps& steps : forces_) {
          const double begin = steps.begin - static_cast<double>(sample - 1 + n),
                       end = steps.calc_end() - static_cast<double>(sample - 1 + n);
          if (begin * substeps - step > 1.0 || end * substeps - step <= 0.0) continue;
          const StepMoments moments = calc_moments(steps, begin * substeps - step, steps.step * substeps);
          for (std::size_t i = first; i < last; ++i) {
            const auto& m = modes[i];
            const std::array<double, 3> amplitudes = calc_amplitudes(steps, i);
            for (int axis = 0; axis < steps.axes; ++axis) {
              for (int j = 0; j < kMoments; ++j) {
                damped_[i].q += amplitudes[axis] * moments[axis][j] * m.force_q[j];
                damped_[i].v += amplitudes[axis] * moments[axis][j] * m.force_v[j];
              }
            }
          }
        }
      }
      double pressure = 0.0;
      for (std::size_t i = first; i < last; ++i) {
        const auto& m = modes[i];
        DampedState& s = damped_[i];
        if (!forced) s = {m.qq * s.q + m.qv * s.v, m.vq * s.q + m.vv * s.v};
        pressure += m.gain * s.v;
      }
      out[n] += static_cast<float>(pressure);
    }
    first = last;
  }
}

/// Drops groups from the end that cannot be heard any more.
void Voice::cull() noexcept {
  const double share = silence_pa_ / static_cast<double>(groups_ + 1);
  for (; live_ > 0; --live_) {
    ModeState& state = state_[static_cast<std::size_t>(live_ - 1)];
    const StrikeTable& table = model_->strike_[static_cast<std::size_t>(live_ - 1)];
    double bound = 0.0;
    for (int lane = 0; lane < kGroup; ++lane) {
      const double weight = std::hypot(table.out_re[lane], table.out_im[lane]);
      bound += weight * std::sqrt(state.re[lane] * state.re[lane] + state.im[lane] * state.im[lane]);
    }
    if (bound >= share) break;
    state = ModeState{};
  }
  double bound = 0.0;
  for (std::size_t i = 0; i < damped_.size(); ++i) {
    // q' of an unforced mode never exceeds |q'| + 2 omega |q| from here on.
    bound += (std::abs(damped_[i].v) + model_->damped_[i].bound * std::abs(damped_[i].q)) * std::abs(model_->damped_[i].gain);
  }
  damped_live_ = damped_live_ && bound >= share;
  if (!damped_live_) std::fill(damped_.begin(), damped_.end(), DampedState{});
}

std::span<const float> Voice::measure(float nearness) noexcept {
  float largest = 0.0F;
  for (int g = live_ - 1; g >= 0; --g) {
    const ModeState& state = state_[static_cast<std::size_t>(g)];
    const auto& weight = model_->weight_[static_cast<std::size_t>(g)];
    std::array<float, kGroup> size;
    for (int lane = 0; lane < kGroup; ++lane) {
      const auto re = static_cast<float>(state.re[lane]), im = static_cast<float>(state.im[lane]);
      size[lane] = weight[lane] * std::sqrt(re * re + im * im);
    }
    float sum = 0.0F;
    for (const float part : size) sum += part;
    largest = std::max(largest, nearness * sum);
    bounds_[static_cast<std::size_t>(g)] = largest;
  }
  return get_measured();
}

/// Renders the groups from `groups` on once more, on their way out, for the period that begins.
void Voice::fade_out(int groups) noexcept {
  const int gone = live_ - groups;
  if (!fading_) fade_.fill(0.0F);
  block_.fill(0.0F);  // not yet in use
  kernels_->ring(model_->sound_.data() + groups, model_->turn_.data() + groups, state_.data() + groups, gone, block_.data());
  counters_.mode_samples += static_cast<std::int64_t>(gone) * kGroup * kPeriod;
  for (int n = 0; n < kPeriod; ++n) fade_[n] += block_[n] * (1.0F - static_cast<float>(n) / kPeriod);
  std::fill(state_.begin() + groups, state_.begin() + live_, ModeState{});
  live_ = groups;
  fading_ = true;
}

void Voice::set_limit(int modes) noexcept { limit_ = std::clamp((modes + kGroup - 1) / kGroup, std::min(1, groups_), groups_); }

/// At the start of a period: holds the energy against that of the period before, when nothing acted in it.
void Voice::audit() noexcept {
  constexpr double kSmallest = 1e-280;  // below, squares are flushed to zero one by one
  const double before = std::exchange(energy_j_, calc_energy_j());
  if (undisturbed_ && before > kSmallest) counters_.energy_rise = std::max(counters_.energy_rise, energy_j_ / before - 1.0);
  undisturbed_ = true;
  if (before == 0.0 && energy_j_ == 0.0) return;
  for (std::size_t m = 0; m < radiation_.size(); ++m) {
    Radiation& mode = radiation_[m];
    counters_.radiated_j += mode.part * std::exchange(mode.energy_j, calc_ringing_energy_j(static_cast<int>(m)));
  }
}

void Voice::reset() noexcept {
  std::fill(state_.begin(), state_.end(), ModeState{});
  std::fill(damped_.begin(), damped_.end(), DampedState{});
  live_ = 0;
  damped_live_ = false;
  fading_ = inherits_ = false;
  pulses_.clear();
  forces_.clear();
  ++counters_.resets;
}

std::size_t Voice::calc_bytes() const {
  return sizeof(Voice) + state_.capacity() * sizeof(ModeState) + starts_.capacity() * sizeof(Starts) +
         damped_.capacity() * sizeof(DampedState) + damped_amplitude_.capacity() * sizeof(double) + pulses_.capacity() * sizeof(Pulse) +
         forces_.capacity() * sizeof(Steps) + bounds_.capacity() * sizeof(float) + radiation_.capacity() * sizeof(Radiation);
}

int Voice::get_live_mode_count() const {
  return std::min(live_ * kGroup, model_->ringing_) + (damped_live_ ? static_cast<int>(damped_.size()) : 0);
}

double Voice::calc_ringing_energy_j(int m) const noexcept {
  const auto& mode = model_->modes_[static_cast<std::size_t>(m)];
  const ModeState& state = state_[static_cast<std::size_t>(m / kGroup)];
  const double omega = std::sqrt(mode.lambda);
  const double q = state.im[m % kGroup] / std::sqrt((omega - mode.decay) * (omega + mode.decay));
  const double v = state.re[m % kGroup] - mode.decay * q;
  return 0.5 * (v * v + mode.lambda * q * q);
}

double Voice::calc_energy_j() const noexcept {
  double energy = 0.0;
  for (int m = 0; m < std::min(live_ * kGroup, model_->ringing_); ++m) energy += calc_ringing_energy_j(m);
  for (std::size_t i = 0; i < damped_.size(); ++i) {
    const double lambda = model_->modes_[static_cast<std::size_t>(model_->ringing_) + i].lambda;
    energy += 0.5 * (damped_[i].v * damped_[i].v + lambda * damped_[i].q * damped_[i].q);
  }
  return energy;
}

}  // namespace carillon::synth

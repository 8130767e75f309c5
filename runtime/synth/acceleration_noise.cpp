// Method:     a rigid sphere of velocity U radiates the far pressure rho0 c0 (a / r) cos(theta) H(s) U(s), delayed by (r - a) / c0, with T
//             = a / c0 and H = (sT)^2 / ((sT)^2 + 2 sT + 2). With U' = F / m that is rho0 c0 (a / m) q', q'' + (2 / T) q' + (2 / T^2) q =
//             F: one oscillator per axis at 1 / sqrt(2) of critical damping, for which z = (q' + q / T) + i q / T rotates by e^{(-1 + i) h
//             / T} and q' = Re z - Im z. The force acts through its Chebyshev moments as on any mode (pulse.hpp); samples are divided into
//             substeps if T is short.
// Source:     Morse & Ingard, Theoretical Acoustics (1968), 7.2, the order l = 1 in closed form; in graphics: Chadwick, Zheng & James 2012.
// Deviations: spheres in the far field; rotation does not radiate. Forces slower than a pulse, such as rolling, are left out: steady forces
//             do not accelerate a resting body.
#include "runtime/synth/acceleration_noise.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/bank/bank.hpp"
#include "runtime/base/error.hpp"

namespace carillon::synth {
namespace {

constexpr int kMaxSubsteps = 256;     // limits the radius to 0.03 mm at 48 kHz
constexpr double kSilencePa = 1e-10;  // as ResonatorOptions::silence_pa

}  // namespace

AccelerationNoise::AccelerationNoise(double radius_m, double mass_kg, double sample_rate_hz, int max_strikes, int max_forces)
    : rate_hz_(sample_rate_hz) {
  const bool fit = radius_m > 0.0 && mass_kg > 0.0 && sample_rate_hz > 0.0 && std::isfinite(radius_m / mass_kg * sample_rate_hz);
  if (!fit) throw InputError("acceleration noise needs a positive radius, mass and sample rate");
  radius_s_ = std::max(radius_m / bank::kSoundSpeedMs, 1.0 / (kMaxSubsteps * sample_rate_hz));
  gain_ = bank::kAirDensityKgM3 * bank::kSoundSpeedMs * radius_m / mass_kg;
  const double h = 1.0 / (sample_rate_hz * radius_s_);
  substeps_ = std::clamp(static_cast<int>(std::ceil(h)), 1, kMaxSubsteps);
  const Complex rate(-1.0, 1.0);
  turn_ = std::exp(rate * h);
  sub_turn_ = std::exp(rate * (h / substeps_));
  const auto points = get_chebyshev_points();
  std::array<double, kMoments> re{}, im{};
  for (int k = 0; k < kMoments; ++k) {
    const Complex answer = std::exp(rate * (h / substeps_ * (1.0 - points[k])));
    re[k] = answer.real();
    im[k] = answer.imag();
  }
  const Moments coefficient_re = calc_chebyshev_coefficients(re), coefficient_im = calc_chebyshev_coefficients(im);
  for (int j = 0; j < kMoments; ++j) force_[j] = {coefficient_re[j], coefficient_im[j]};
  pulses_.reserve(std::max(max_strikes, 1));
  forces_.reserve(std::max(max_forces, 0));
}

bool AccelerationNoise::strike(const events::Impulse& impulse, const events::Quaternion& to_world) noexcept {
  const Vec3 turned = turn(to_world, impulse.impulse_n_s);
  const double length = calc_pulse_length(impulse.shape, impulse.duration_s) * rate_hz_;
  double begin = (impulse.time_s - radius_s_) * rate_hz_ - 0.5 * length;
  const bool finite = std::isfinite(begin) && std::isfinite(turned[0]) && std::isfinite(turned[1]) && std::isfinite(turned[2]);
  if (!finite || !(length >= 0.0) || pulses_.size() == pulses_.capacity()) {
    ++refused_;
    return false;
  }
  const double earliest = static_cast<double>(position_ - 1);
  if (!(begin > earliest)) begin = std::nextafter(earliest, earliest + 1.0);
  pulses_.push_back({begin, length, impulse.shape, turned});
  return true;
}

bool AccelerationNoise::push(const events::Force& force, const events::Quaternion& to_world) noexcept {
  Steps steps;
  steps.begin = (force.time_s - radius_s_) * rate_hz_;
  steps.step = std::max(force.step_s * rate_hz_, kShortestStep);
  steps.count = force.count;
  bool sane = std::isfinite(steps.begin) && std::isfinite(steps.step) && force.step_s > 0.0 && steps.count >= 1 &&
              steps.count <= events::kMaxForceSteps && forces_.size() < forces_.capacity();
  for (std::size_t k = 0; sane && k < static_cast<std::size_t>(steps.count); ++k) {
    const auto& [x, y, z] = force.impulse_n_s[k];
    const Vec3 turned = turn(to_world, {x, y, z});
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sane = sane && std::isfinite(turned[axis]);
      steps.impulse_n_s[k][axis] = static_cast<float>(turned[axis]);
    }
  }
  if (!sane) {
    ++refused_;
    return false;
  }
  const double earliest = static_cast<double>(position_ - 1);
  if (!(steps.begin > earliest)) steps.begin = std::nextafter(earliest, earliest + 1.0);
  forces_.push_back(steps);
  return true;
}

void AccelerationNoise::reset() noexcept {
  state_.fill(0.0);
  pulses_.clear();
  forces_.clear();
  awake_ = false;
}

void AccelerationNoise::take_over(const AccelerationNoise& other) noexcept {
  position_ = other.position_;
  refused_ = other.refused_;
  awake_ = other.awake_;
  for (std::size_t axis = 0; axis < 3; ++axis) state_[axis] = other.state_[axis] * (other.gain_ / gain_);
  pulses_.clear();
  for (const Pulse& pulse : other.pulses_) {
    if (pulses_.size() < pulses_.capacity())
      pulses_.push_back(pulse);
    else
      ++refused_;
  }
  forces_.clear();
  for (const Steps& steps : other.forces_) {
    if (forces_.size() < forces_.capacity())
      forces_.push_back(steps);
    else
      ++refused_;
  }
}

/// State change over the sample at position_ by a pulse of unit impulse.
AccelerationNoise::Complex AccelerationNoise::calc_answer(const Pulse& pulse) const noexcept {
  const double begin = pulse.begin - static_cast<double>(position_ - 1);  // the interval of sample n is (n - 1, n]
  Complex sum = 0.0;
  for (int step = 0; step < substeps_; ++step) {
    sum *= sub_turn_;
    const Moments moments = calc_pulse_moments(pulse.shape, begin * substeps_ - step, pulse.length * substeps_);
    if (moments[0] == 0.0) continue;
    for (int j = 0; j < kMoments; ++j) sum += moments[j] * force_[j];
  }
  return sum;
}

/// Adds a force over the sample at position_ to the state.
void AccelerationNoise::add_answer(const Steps& steps) noexcept {
  const double begin = steps.begin - static_cast<double>(position_ - 1);
  std::array<Complex, 3> sum{};
  for (int part = 0; part < substeps_; ++part) {
    for (Complex& z : sum) z *= sub_turn_;
    for (int k = 0; k < steps.count; ++k) {
      const Moments moments = calc_level_moments((begin + k * steps.step) * substeps_ - part, steps.step * substeps_);
      if (moments[0] == 0.0) continue;
      Complex answer = 0.0;
      for (int j = 0; j < kMoments; ++j) answer += moments[j] * force_[j];
      for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += static_cast<double>(steps.impulse_n_s[k][axis]) * answer;
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) state_[axis] += sum[axis];
}

void AccelerationNoise::process(const std::array<std::span<float>, 3>& dipole_pa) noexcept {
  for (std::size_t i = 0; i < dipole_pa[0].size(); ++i, ++position_) {
    double size = 0.0;
    if (awake_) {
      for (Complex& z : state_) {
        z *= turn_;
        size += std::abs(z.real()) + std::abs(z.imag());
      }
      if (!(gain_ * size >= kSilencePa)) {  // true also for NaN
        state_.fill(0.0);
        awake_ = false;
      }
    }
    for (std::size_t k = 0; k < pulses_.size();) {
      const Pulse& pulse = pulses_[k];
      if (pulse.begin <= static_cast<double>(position_)) {
        const Complex answer = calc_answer(pulse);
        for (std::size_t axis = 0; axis < 3; ++axis) state_[axis] += pulse.impulse_n_s[axis] * answer;
        awake_ = true;
      }
      if (pulse.begin + pulse.length <= static_cast<double>(position_)) {
        pulses_.erase(pulses_.begin() + static_cast<std::ptrdiff_t>(k));
      } else {
        ++k;
      }
    }
    for (const Steps& steps : forces_) {
      if (steps.begin > static_cast<double>(position_)) continue;
      add_answer(steps);
      awake_ = true;
    }
    std::erase_if(forces_, [this](const Steps& steps) { return steps.begin + steps.count * steps.step <= static_cast<double>(position_); });
    for (std::size_t axis = 0; axis < 3; ++axis) {
      dipole_pa[axis][i] = awake_ ? static_cast<float>(gain_ * (state_[axis].real() - state_[axis].imag())) : 0.0F;
    }
  }
}

}  // namespace carillon::synth

// Method:     without forces (q, q') follows its exact map per sample. With forces stiff modes take several substeps per sample, each with
//             the exact response to the moments of the force; if the fast root decays within a thousandth of a sample it follows the force,
//             and only the slow root is integrated.
// Source:     docs/equations.md E4 and E5.
#include "runtime/synth/damped_modes.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace carillon::synth {
namespace {

/// phi . impulse of a mode [N s kg^-1/2]. `column` of the model's shapes.
double calc_amplitude(const std::int16_t* const* row, const float* weight, std::size_t column, double scale) noexcept {
  double amplitude = 0.0;
  for (int r = 0; r < kStrikeRows; ++r) amplitude += static_cast<double>(weight[r]) * row[r][column];
  return amplitude * scale;
}

double calc_amplitude(const QueuedPulse& pulse, const Model& model, std::size_t mode) noexcept {
  return calc_amplitude(pulse.row, pulse.weight, model.get_damped_column(mode), model.get_damped_modes()[mode].scale);
}

/// phi of a mode along the directions of a force.
std::array<double, 3> calc_amplitudes(const QueuedForce& force, const Model& model, std::size_t mode) noexcept {
  const std::int16_t* row[kStrikeRows];
  float weight[kStrikeRows];
  model.find_rows(force.triangle, row);
  std::array<double, 3> amplitudes{};
  for (int axis = 0; axis < force.axes; ++axis) {
    force.find_weights(axis, weight);
    amplitudes[axis] = calc_amplitude(row, weight, model.get_damped_column(mode), model.get_damped_modes()[mode].scale);
  }
  return amplitudes;
}

}  // namespace

/// One sample of a mode with a fast root f: with A the integral of the force times e^{-s age}, s the slow root, and B that of f e^{-f age},
/// q = (A - B / f) / (f - s), q' = (B - s A) / (f - s). B is the force at 1 / f earlier, up to its second derivative over f squared. `n`:
/// sample within the sub-block of the contacts.
void DampedModes::follow_force(std::size_t mode, std::int64_t sample, const StrikeQueue& strikes, const ContactForces* contacts,
                               int n) noexcept {
  const Model::DampedMode& m = model_->get_damped_modes()[mode];
  DampedState& state = states_[mode];
  const double rate_hz = model_->get_rate_hz(), lag = rate_hz / m.fast;  // samples
  double slow = (m.fast * state.q + state.v) * std::exp(-m.slow / rate_hz), fast = 0.0;
  if (contacts != nullptr) {
    const float* force = contacts->get_damped_force(mode) + n;
    const auto& ramp = contacts->get_ramp();
    const auto begin = static_cast<double>(force[0]), end = static_cast<double>(force[1]);
    for (int j = 0; j < kMoments; ++j) slow += (begin * ramp[0][j] + end * ramp[1][j]) * m.force_q[j];
    fast += end - lag * (end - begin);
  }
  for (const QueuedPulse& pulse : strikes.get_pulses()) {
    const double begin = pulse.begin - static_cast<double>(sample - 1);
    if (begin > 1.0 || begin + pulse.length <= 0.0) continue;
    const Moments moments = calc_pulse_moments(pulse.shape, begin, pulse.length);
    const double amplitude = calc_amplitude(pulse, *model_, mode);
    for (int j = 0; j < kMoments; ++j) slow += amplitude * moments[j] * m.force_q[j];
    if (pulse.length > 2.0 * lag) fast += amplitude * calc_pulse(pulse.shape, (1.0 - lag - begin) / pulse.length) * rate_hz / pulse.length;
  }
  for (const QueuedForce& force : strikes.get_forces()) {
    const double begin = force.begin - static_cast<double>(sample - 1);
    if (begin > 1.0 || force.calc_end() <= static_cast<double>(sample - 1)) continue;
    const ForceMoments moments = calc_force_moments(force, begin, force.step);
    const std::array<double, 3> amplitudes = calc_amplitudes(force, *model_, mode);
    const double at = std::floor((1.0 - lag - begin) / force.step);
    for (int axis = 0; axis < force.axes; ++axis) {
      for (int j = 0; j < kMoments; ++j) slow += amplitudes[axis] * moments[axis][j] * m.force_q[j];
      if (at >= 0.0 && at < force.count) fast += amplitudes[axis] * force.along[axis][static_cast<int>(at)] * rate_hz / force.step;
    }
  }
  const double width = m.fast - m.slow;
  state = {(slow - fast / m.fast) / width, (fast - m.slow * slow) / width};
}

/// The force of contacts is linear over the sample.
void DampedModes::add_contacts(const Range& range, int step, const ContactForces& contacts, int n) noexcept {
  for (std::size_t i = range.first; i < range.last; ++i) {
    const Model::DampedMode& m = model_->get_damped_modes()[i];
    const float* force = contacts.get_damped_force(i) + n;
    const auto& ramp = contacts.get_ramp();
    const double slope = (static_cast<double>(force[1]) - static_cast<double>(force[0])) / range.substeps;
    const double begin = static_cast<double>(force[0]) + slope * step;
    for (int j = 0; j < kMoments; ++j) {
      const double impulse = (begin * ramp[0][j] + (begin + slope) * ramp[1][j]) / range.substeps;
      states_[i].q += impulse * m.force_q[j];
      states_[i].v += impulse * m.force_v[j];
    }
  }
}

void DampedModes::add_pulses(const Range& range, std::int64_t sample, int step, std::span<const QueuedPulse> pulses) noexcept {
  for (const QueuedPulse& pulse : pulses) {
    const double begin = pulse.begin - static_cast<double>(sample - 1);
    if (begin > 1.0 || begin + pulse.length <= 0.0) continue;
    const Moments moments = calc_pulse_moments(pulse.shape, begin * range.substeps - step, pulse.length * range.substeps);
    if (moments[0] == 0.0) continue;
    for (std::size_t i = range.first; i < range.last; ++i) {
      const Model::DampedMode& m = model_->get_damped_modes()[i];
      const double amplitude = calc_amplitude(pulse, *model_, i);
      for (int j = 0; j < kMoments; ++j) {
        states_[i].q += amplitude * moments[j] * m.force_q[j];
        states_[i].v += amplitude * moments[j] * m.force_v[j];
      }
    }
  }
}

void DampedModes::add_forces(const Range& range, std::int64_t sample, int step, std::span<const QueuedForce> forces) noexcept {
  for (const QueuedForce& force : forces) {
    const double begin = force.begin - static_cast<double>(sample - 1), end = force.calc_end() - static_cast<double>(sample - 1);
    if (begin * range.substeps - step > 1.0 || end * range.substeps - step <= 0.0) continue;
    const ForceMoments moments = calc_force_moments(force, begin * range.substeps - step, force.step * range.substeps);
    for (std::size_t i = range.first; i < range.last; ++i) {
      const Model::DampedMode& m = model_->get_damped_modes()[i];
      const std::array<double, 3> amplitudes = calc_amplitudes(force, *model_, i);
      for (int axis = 0; axis < force.axes; ++axis) {
        for (int j = 0; j < kMoments; ++j) {
          states_[i].q += amplitudes[axis] * moments[axis][j] * m.force_q[j];
          states_[i].v += amplitudes[axis] * moments[axis][j] * m.force_v[j];
        }
      }
    }
  }
}

/// Substep of the modes of a range. `n`: sample within the sub-block.
void DampedModes::step(const Range& range, std::int64_t sample, int step, const StrikeQueue& strikes, const ContactForces* contacts,
                       int n) noexcept {
  for (std::size_t i = range.first; i < range.last; ++i) {
    const Model::DampedMode& m = model_->get_damped_modes()[i];
    DampedState& s = states_[i];
    s = {m.sub_qq * s.q + m.sub_qv * s.v, m.sub_vq * s.q + m.sub_vv * s.v};
  }
  if (contacts != nullptr) add_contacts(range, step, *contacts, n);
  add_pulses(range, sample, step, strikes.get_pulses());
  add_forces(range, sample, step, strikes.get_forces());
}

/// Modes with as many substeps as the first; all remaining ones without a force.
DampedModes::Range DampedModes::find_range(std::size_t first, bool forced) const noexcept {
  const auto& modes = model_->get_damped_modes();
  if (!forced) return {first, modes.size(), 1};
  Range range{first, first + 1, modes[first].substeps};
  while (range.last < modes.size() && modes[range.last].substeps == range.substeps) ++range.last;
  return range;
}

void DampedModes::add(std::int64_t sample, const StrikeQueue& strikes, bool struck, const ContactForces* contacts, float* out,
                      DampedState* states) noexcept {
  const bool forced = struck || contacts != nullptr;
  const auto& modes = model_->get_damped_modes();
  is_live_ = !modes.empty();
  for (std::size_t first = 0; first < modes.size();) {
    const Range range = find_range(first, forced);
    for (int n = 0; n < kSubBlock; ++n) {
      if (forced && range.substeps == 0)
        for (std::size_t i = range.first; i < range.last; ++i) follow_force(i, sample + n, strikes, contacts, n);
      if (forced)
        for (int substep = 0; substep < range.substeps; ++substep) step(range, sample + n, substep, strikes, contacts, n);
      double pressure = 0.0;
      for (std::size_t i = range.first; i < range.last; ++i) {
        const Model::DampedMode& m = modes[i];
        DampedState& s = states_[i];
        if (!forced) s = {m.qq * s.q + m.qv * s.v, m.vq * s.q + m.vv * s.v};
        pressure += m.gain * s.v;
        if (states != nullptr) states[static_cast<std::size_t>(n) * modes.size() + i] = s;
      }
      out[n] += static_cast<float>(pressure);
    }
    first = range.last;
  }
}

void DampedModes::drop_below(double pressure_pa) noexcept {
  double bound = 0.0;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    // An unforced mode never exceeds |q'| + 2 omega |q|.
    const Model::DampedMode& m = model_->get_damped_modes()[i];
    bound += (std::abs(states_[i].v) + m.bound * std::abs(states_[i].q)) * std::abs(m.gain);
  }
  is_live_ = is_live_ && bound >= pressure_pa;
  if (!is_live_) reset();
}

void DampedModes::reset() noexcept {
  std::fill(states_.begin(), states_.end(), DampedState{});
  is_live_ = false;
}

double DampedModes::calc_energy_j() const noexcept {
  double energy = 0.0;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const double lambda = model_->get_eigenvalue_rad2_s2(model_->get_ringing_mode_count() + static_cast<int>(i));
    energy += 0.5 * (states_[i].v * states_[i].v + lambda * states_[i].q * states_[i].q);
  }
  return energy;
}

}  // namespace carillon::synth

#include "runtime/synth/ringing_modes.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/synth/oscillator.hpp"

namespace carillon::synth {

double calc_damped_omega(const Model& model, int mode) noexcept {
  return calc_damped_omega(model.get_eigenvalue_rad2_s2(mode), model.get_decay_per_s(mode));
}

RingingModes::RingingModes(const Model& model, Isa isa) : model_(&model), kernels_(&synth::get_kernels(isa)) {
  const std::size_t groups = model.get_sound_tables().size();
  max_groups_ = static_cast<int>(groups);
  states_.resize(groups);
  starts_.resize(groups);
  bounds_.resize(groups);
}

int RingingModes::get_mode_count() const noexcept { return std::min(ringing_groups_ * kGroup, model_->get_ringing_mode_count()); }

void RingingModes::wake(int groups) noexcept {
  for (const int last = std::min(groups, max_groups_); ringing_groups_ < last; ++ringing_groups_) starts_[ringing_groups_] = ColumnStates{};
}

void RingingModes::truncate(int groups) noexcept {
  std::fill(states_.begin() + groups, states_.begin() + ringing_groups_, ModeState{});
  ringing_groups_ = groups;
}

void RingingModes::drop_below(double pressure_pa, std::span<const std::array<float, kGroup>> weights) noexcept {
#if defined(__wasm__)
  // No flush to zero there: a mode that decays before its neighbours of a group would become denormal. 1e-7 of the dropped level.
  constexpr double kZeroed = 1e-25;
  for (ModeState& state : get_states()) {
    for (int lane = 0; lane < kGroup; ++lane) {
      if (std::abs(state.re[lane]) + std::abs(state.im[lane]) < kZeroed) state.re[lane] = state.im[lane] = 0.0;
    }
  }
#endif
  for (; ringing_groups_ > 0; --ringing_groups_) {
    ModeState& state = states_[ringing_groups_ - 1];
    const auto& weight = weights[ringing_groups_ - 1];
    double bound = 0.0;
    for (int lane = 0; lane < kGroup; ++lane)
      bound += static_cast<double>(weight[lane]) * std::sqrt(state.re[lane] * state.re[lane] + state.im[lane] * state.im[lane]);
    if (bound >= pressure_pa) break;
    state = ModeState{};
  }
}

std::span<const float> RingingModes::measure(float nearness, std::span<const std::array<float, kGroup>> weights) noexcept {
  float largest = 0.0F;
  for (int g = ringing_groups_ - 1; g >= 0; --g) {
    const ModeState& state = states_[g];
    const auto& weight = weights[g];
    std::array<float, kGroup> size;
    for (int lane = 0; lane < kGroup; ++lane) {
      const auto re = static_cast<float>(state.re[lane]), im = static_cast<float>(state.im[lane]);
      size[lane] = weight[lane] * std::sqrt(re * re + im * im);
    }
    float sum = 0.0F;
    for (const float part : size) sum += part;
    largest = std::max(largest, nearness * sum);
    bounds_[g] = largest;
  }
  return get_measured();
}

DampedState RingingModes::get_state(int mode) const noexcept {
  const ModeState& state = states_[mode / kGroup];
  const double q = state.im[mode % kGroup] / calc_damped_omega(*model_, mode);
  return {q, state.re[mode % kGroup] - model_->get_decay_per_s(mode) * q};
}

DampedState RingingModes::get_state_at(int mode, int column) const noexcept {
  if (mode / kGroup >= ringing_groups_) return {};
  const ColumnStates& start = starts_[mode / kGroup];
  const double q = static_cast<double>(start.im[column][mode % kGroup]) / calc_damped_omega(*model_, mode);
  return {q, static_cast<double>(start.re[column][mode % kGroup]) - model_->get_decay_per_s(mode) * q};
}

void RingingModes::set_state(int mode, const DampedState& state) noexcept {
  ModeState& group = states_[mode / kGroup];
  group.re[mode % kGroup] = state.v + model_->get_decay_per_s(mode) * state.q;
  group.im[mode % kGroup] = state.q * calc_damped_omega(*model_, mode);
  ringing_groups_ = std::max(ringing_groups_, mode / kGroup + 1);
}

double RingingModes::calc_amplitude(int mode) const noexcept {
  const ModeState& state = states_[mode / kGroup];
  return std::hypot(state.re[mode % kGroup], state.im[mode % kGroup]) / calc_damped_omega(*model_, mode);
}

double RingingModes::calc_energy_j() const noexcept {
  double energy = 0.0;
  for (int m = 0; m < get_mode_count(); ++m) {
    const auto [q, v] = get_state(m);
    energy += 0.5 * (v * v + model_->get_eigenvalue_rad2_s2(m) * q * q);
  }
  return energy;
}

}  // namespace carillon::synth

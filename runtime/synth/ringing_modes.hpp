// Under-damped modes of a ResonatorBank, in groups sorted by audibility.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "runtime/synth/damped_modes.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"

namespace carillon::synth {

/// States at the start of the next block and of each column of this one. Invariant: groups from get_ringing_groups() on have no energy.
/// Allocates in the constructor only.
class RingingModes {
 public:
  /// The model must outlive the result.
  RingingModes(const Model& model, Isa isa);

  int get_model_groups() const noexcept { return static_cast<int>(states_.size()); }
  int get_ringing_groups() const noexcept { return ringing_groups_; }
  /// Number of ringing modes, without empty lanes.
  int get_mode_count() const noexcept;
  const Kernels& get_kernels() const noexcept { return *kernels_; }
  std::span<ModeState> get_states() noexcept { return std::span(states_).first(static_cast<std::size_t>(ringing_groups_)); }
  ModeState* get_state_data() noexcept { return states_.data(); }
  /// Valid for ringing groups, unless the block was rendered by ring().
  ColumnStates* get_starts() noexcept { return starts_.data(); }
  const ColumnStates* get_starts() const noexcept { return starts_.data(); }

  /// Limits the groups that wake() may start.
  void set_max_groups(int groups) noexcept { max_groups_ = groups; }
  int get_max_groups() const noexcept { return max_groups_; }
  /// Starts groups at rest, up to `groups` ringing ones.
  void wake(int groups) noexcept;
  /// Clears the groups from `groups` on.
  void truncate(int groups) noexcept;
  void reset() noexcept { truncate(0); }
  /// Drops groups from the end whose pressure bound is below this. `weights`: bound on the pressure per size of the state.
  void drop_below(double pressure_pa, std::span<const std::array<float, kGroup>> weights) noexcept;
  /// Bounds on the pressure of each ringing group, or of a later one if larger, so that they never grow along the list; times `nearness`.
  /// Valid until the next call.
  std::span<const float> measure(float nearness, std::span<const std::array<float, kGroup>> weights) noexcept;
  std::span<const float> get_measured() const noexcept { return std::span(bounds_).first(static_cast<std::size_t>(ringing_groups_)); }

  /// State of a mode at the start of the next block.
  DampedState get_state(int mode) const noexcept;
  /// State of a mode at the start of a column of this block.
  DampedState get_state_at(int mode, int column) const noexcept;
  /// Sets a mode and makes its group ring.
  void set_state(int mode, const DampedState& state) noexcept;
  /// Puts a mode to rest.
  void clear_state(int mode) noexcept { states_[mode / kGroup].re[mode % kGroup] = states_[mode / kGroup].im[mode % kGroup] = 0.0; }
  /// Amplitude of q [m kg^1/2] of a mode.
  double calc_amplitude(int mode) const noexcept;
  /// Sum of (q'^2 + lambda q^2) / 2 [J].
  double calc_energy_j() const noexcept;

 private:
  const Model* model_;
  const Kernels* kernels_;
  int max_groups_ = 0;
  int ringing_groups_ = 0;
  std::vector<ModeState> states_;
  std::vector<ColumnStates> starts_;
  std::vector<float> bounds_;  // of measure()
};

/// Of a mode of a model.
double calc_damped_omega(const Model& model, int mode) noexcept;

}  // namespace carillon::synth

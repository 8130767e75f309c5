// Coupled modes of a ResonatorBank: sample by sample, in place of their lanes in the groups.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/synth/damped_modes.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/nonlinear/cascade.hpp"
#include "runtime/synth/nonlinear/coupled_modes.hpp"
#include "runtime/synth/strike_queue.hpp"

namespace carillon::synth {

/// Response of a mode's state to the Chebyshev moments of a force over a sample.
struct ForceAnswer {
  Moments re{}, im{};
};
ForceAnswer calc_force_answer(const nonlinear::ModeConstants& mode, double rate_hz);

/// Tables for Effect::kNonlinear, for banks with a nonlinear energy. N coupled modes, in the order of the energy: those that ring below the
/// Nyquist frequency.
struct ModelNonlinear {
  bank::QuarticEnergy energy;
  std::vector<int> mode;  // (N) of the model
  std::vector<nonlinear::ModeConstants> constants;
  std::vector<ForceAnswer> answer;  // (N)
  std::vector<StrikeTable> strike;  // strike tables of the model without these modes
  int groups = 0;                   // groups up to the last one with such a mode
  std::vector<int> above;           // modes of the model that ring at higher frequencies, ascending
};

/// States are those at the last rendered sample; at rest while is_live() is false. Allocates in the constructor only.
class NonlinearModes {
 public:
  /// The model must outlive the result and have a nonlinear energy, and Model::has_cascade() with a cascade, whose modes follow the coupled
  /// ones.
  explicit NonlinearModes(const Model& model, bool has_cascade = false);

  bool is_live() const noexcept { return modes_.is_moving() || has_carry_ || (cascade_ && cascade_->is_moving()); }
  int get_count() const noexcept { return static_cast<int>(mode_.size()); }
  int get_coupled_count() const noexcept { return modes_.get_count(); }
  int get_cascade_count() const noexcept { return cascade_ ? cascade_->get_count() : 0; }
  /// Numbers in the model.
  std::span<const int> get_modes() const noexcept { return mode_; }
  /// Strike tables of the model without these modes.
  const StrikeTable* get_strike_tables() const noexcept { return cascade_ ? strike_.data() : nonlinear_->strike.data(); }
  int get_group_count() const noexcept;
  /// Index of a mode of the model; -1: none.
  int find_place(int mode) const noexcept { return place_[mode]; }

  /// Adds the pressure [Pa at 1 m] of the kSubBlock samples from `sample` on. `struck`: some of `strikes` act; `drive`: lasting contacts,
  /// or nullptr. `kept`: receives the states of groups below `groups`, or nullptr.
  void add(std::int64_t sample, const StrikeQueue& strikes, bool struck, const ContactBlock* drive, float* out, SampleStates* kept,
           int groups) noexcept;

  /// State of mode i at the next sample, without coupling on the way.
  DampedState get_state(int i) const noexcept;
  void set_state(int i, const DampedState& state) noexcept;
  /// Limits the number of coupled modes.
  void set_limit(int modes) noexcept { modes_.set_limit(modes); }
  int get_limit() const noexcept { return modes_.get_limit(); }  // coupled modes now
  /// Silences all modes if their total pressure stays below this.
  void drop_below(double pressure_pa) noexcept;
  void reset() noexcept;
  double calc_energy_j() const noexcept { return modes_.get_energy_j() + (cascade_ ? cascade_->calc_energy_j() : 0.0); }

 private:
  double get_re(int i) const noexcept { return i < get_coupled_count() ? modes_.get_re(i) : cascade_->get_re(i - get_coupled_count()); }
  double get_im(int i) const noexcept { return i < get_coupled_count() ? modes_.get_im(i) : cascade_->get_im(i - get_coupled_count()); }
  double calc_pressure() const noexcept;
  void add_pulses(std::int64_t sample, std::span<const QueuedPulse> pulses) noexcept;
  void add_forces(std::int64_t sample, std::span<const QueuedForce> forces) noexcept;
  void add_contacts(const ContactBlock& drive) noexcept;
  void add_push(int interval, std::size_t i, double amplitude, const Moments& moments) noexcept;

  const Model* model_;
  const ModelNonlinear* nonlinear_;  // of the model
  nonlinear::CoupledModes modes_;
  std::vector<int> mode_;  // modes of the model: coupled ones, then those above
  std::vector<nonlinear::ModeConstants> constants_;
  std::vector<ForceAnswer> answer_;
  std::vector<double> gain_;  // [Pa at 1 m] per velocity
  std::unique_ptr<nonlinear::Cascade> cascade_;
  std::vector<StrikeTable> strike_;  // with a cascade
  std::vector<int> place_;
  int groups_ = 0;
  std::vector<double> push_re_, push_im_, keep_;  // (kSubBlock + 1, N): at the samples of this sub-block and the next one
  bool pushes_ = false;                           // any push in this sub-block
  bool has_carry_ = false, carry_damps_ = false;  // the last row applies to the next sub-block
};

}  // namespace carillon::synth

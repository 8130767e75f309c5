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
#include "runtime/synth/nonlinear/mode_constants.hpp"
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

/// States are those at the last rendered sample; at rest while is_live() is false. Allocates in make_nonlinear_modes() only.
class NonlinearModes {
 public:
  virtual ~NonlinearModes() = default;

  virtual bool is_live() const noexcept = 0;
  int get_count() const noexcept { return static_cast<int>(get_modes().size()); }
  virtual int get_coupled_count() const noexcept = 0;
  virtual int get_cascade_count() const noexcept = 0;
  /// Numbers in the model.
  virtual std::span<const int> get_modes() const noexcept = 0;
  /// Strike tables of the model without these modes.
  virtual const StrikeTable* get_strike_tables() const noexcept = 0;
  virtual int get_group_count() const noexcept = 0;
  /// Index of a mode of the model; -1: none.
  virtual int find_place(int mode) const noexcept = 0;

  /// Adds the pressure [Pa at 1 m] of the kSubBlock samples from `sample` on. `struck`: some of `strikes` act; `drive`: lasting contacts,
  /// or nullptr. `kept`: receives the states of groups below `groups`, or nullptr.
  virtual void add(std::int64_t sample, const StrikeQueue& strikes, bool struck, const ContactBlock* drive, float* out, SampleStates* kept,
                   int groups) noexcept = 0;

  /// State of mode i at the next sample, without coupling on the way.
  virtual DampedState get_state(int i) const noexcept = 0;
  virtual void set_state(int i, const DampedState& state) noexcept = 0;
  /// Limits the number of coupled modes.
  virtual void set_limit(int modes) noexcept = 0;
  virtual int get_limit() const noexcept = 0;  // coupled modes now
  /// Silences all modes if their total pressure stays below this.
  virtual void drop_below(double pressure_pa) noexcept = 0;
  virtual void reset() noexcept = 0;
  virtual double calc_energy_j() const noexcept = 0;
};

/// The model must outlive the result and have a nonlinear energy, and Model::has_cascade() with a cascade, whose modes follow the coupled
/// ones. Throws InputError in a build without the component NONLINEAR.
std::unique_ptr<NonlinearModes> make_nonlinear_modes(const Model& model, bool has_cascade);

}  // namespace carillon::synth

// Modes at, near or above critical damping. They are few and decay at once, so they run sample by sample in double precision.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/synth/contact_forces.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/strike_queue.hpp"

namespace carillon::synth {

/// Amplitude and velocity of a mode.
struct DampedState {
  double q = 0.0, v = 0.0;
};

/// States are those at the horizon of the owner, and zero while is_live() is false. Allocates in the constructor only.
class DampedModes {
 public:
  /// The model must outlive the result.
  explicit DampedModes(const Model& model) : model_(&model), states_(model.get_damped_modes().size()) {}

  bool is_live() const noexcept { return is_live_; }
  std::size_t get_count() const noexcept { return states_.size(); }
  std::span<const DampedState> get_states() const noexcept { return states_; }
  void set_state(std::size_t mode, const DampedState& state) noexcept {
    states_[mode] = state;
    is_live_ = true;
  }

  /// Adds the pressure [Pa at 1 m] of the kSubBlock samples from `sample` on. `struck`: some of `strikes` act; `contacts`: with a force in
  /// this sub-block, or nullptr. `states`: for the states at each sample, (kSubBlock, modes), or nullptr.
  void add(std::int64_t sample, const StrikeQueue& strikes, bool struck, const ContactForces* contacts, float* out,
           DampedState* states = nullptr) noexcept;

  /// Silences the modes if their total pressure stays below this [Pa at 1 m].
  void drop_below(double pressure_pa) noexcept;
  void reset() noexcept;
  /// Sum of (q'^2 + lambda q^2) / 2 [J].
  double calc_energy_j() const noexcept;

 private:
  /// Modes of equal substeps: first <= mode < last.
  struct Range {
    std::size_t first, last;
    int substeps;
  };

  Range find_range(std::size_t first, bool forced) const noexcept;
  void follow_force(std::size_t mode, std::int64_t sample, const StrikeQueue& strikes, const ContactForces* contacts, int n) noexcept;
  void step(const Range& range, std::int64_t sample, int step, const StrikeQueue& strikes, const ContactForces* contacts, int n) noexcept;
  void add_contacts(const Range& range, int step, const ContactForces& contacts, int n) noexcept;
  void add_pulses(const Range& range, std::int64_t sample, int step, std::span<const QueuedPulse> pulses) noexcept;
  void add_forces(const Range& range, std::int64_t sample, int step, std::span<const QueuedForce> forces) noexcept;

  const Model* model_;
  std::vector<DampedState> states_;
  bool is_live_ = false;
};

}  // namespace carillon::synth

// Energy balance of the modes: work of forces, and losses to damping.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/synth/damped_modes.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/oscillator.hpp"

namespace carillon::synth {

/// Energies of a body's modes [J]: given = held + lost, at any time.
struct ModeEnergy {
  double given_j = 0.0;     // net work of pulses, forces, sliding, rolling and contact damping
  double lost_j = 0.0;      // to damping, and with modes that were silenced
  double held_j = 0.0;      // at the moment
  double radiated_j = 0.0;  // part of lost_j

  ModeEnergy& operator+=(const ModeEnergy& other) noexcept {
    given_j += other.given_j;
    lost_j += other.lost_j;
    held_j += other.held_j;
    radiated_j += other.radiated_j;
    return *this;
  }
};

/// Radiated share of a mode's damping: d_r / d with d_r = bank::calc_radiation_decay(gain) and d the bank's total decay; 1 if d_r is
/// larger, which gains not limited by radiation::limit_gains() allow.
double calc_radiated_share(double gain, double decay_per_s) noexcept;

/// Balance of one ResonatorBank, from the states before and after each sub-block with forces and at the start of each block. Loss in free
/// motion: the decrease of energy. Loss under forces: the integral of 2 d q'^2, summed over samples; the rest of the change is work.
class EnergyBook {
 public:
  explicit EnergyBook(const Model& model);

  /// States at a sample, after free motion. get(m): of mode m of the model; is_coupled(m): nonlinear modes, whose energy is `coupled_j` and
  /// whose damping counts as that of linear modes.
  template <class Get, class IsCoupled>
  void note(std::int64_t sample, const Get& get, const IsCoupled& is_coupled, double coupled_j) noexcept {
    note(sample, false, nullptr, 0, false, get, is_coupled, coupled_j);
  }
  /// End of a sub-block with forces, after note() at its beginning. `kept`: their part of the states of the ringing modes at each sample,
  /// of `groups` groups; `is_all`: the whole states.
  template <class Get, class IsCoupled>
  void note_acted(std::int64_t sample, const SampleStates* kept, int groups, bool is_all, const Get& get, const IsCoupled& is_coupled,
                  double coupled_j) noexcept {
    note(sample, true, kept, groups, is_all, get, is_coupled, coupled_j);
  }
  /// Continues the balance `before` from these states.
  template <class Get, class IsCoupled>
  void begin(std::int64_t sample, const ModeEnergy& before, const Get& get, const IsCoupled& is_coupled, double coupled_j) noexcept {
    note(sample_, get, is_coupled, coupled_j);
    sample_ = sample;
    const double held_j = sums_.held_j;
    sums_ = before;
    // Modes missing in one of the models appear and vanish with their energy.
    sums_.lost_j += before.held_j - held_j;
    sums_.held_j = held_j;
  }

  const ModeEnergy& get() const noexcept { return sums_; }
  /// Buffer for `kept`, one per group.
  SampleStates* get_kept() noexcept { return kept_.data(); }

 private:
  struct Mode {
    DampedState state;
    double lambda = 0.0, energy_j = 0.0, share = 0.0;  // share: radiated
    double loss = 0.0;                                 // 2 d over a sample
    double decay = 0.0, omega_d = 0.0;                 // of those that ring
    double turn_re = 0.0, turn_im = 0.0;               // over a sample
    OscillatorMap alone{};                             // damped modes: map over a sub-block
    std::array<double, kSubBlocks> falls{};            // 1 - e^-2 d t over one sub-block to a block
  };
  double calc_lost_j(const Mode& mode, const SampleStates& kept, int lane, bool is_all) const noexcept;
  template <class Get, class IsCoupled>
  void note(std::int64_t sample, bool acted, const SampleStates* kept, int groups, bool is_all, const Get& get, const IsCoupled& is_coupled,
            double coupled_j) noexcept;

  std::vector<Mode> modes_;
  std::vector<SampleStates> kept_;
  std::int64_t sample_ = 0;
  double coupled_j_ = 0.0;
  ModeEnergy sums_;
};

template <class Get, class IsCoupled>
void EnergyBook::note(std::int64_t sample, bool acted, const SampleStates* kept, int groups, bool is_all, const Get& get,
                      const IsCoupled& is_coupled, double coupled_j) noexcept {
  const std::int64_t passed = (sample - sample_) / kSubBlock;
  sample_ = sample;
  double held_j = coupled_j, coupled_lost_j = 0.0;
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    Mode& mode = modes_[m];
    const auto number = static_cast<int>(m);
    const DampedState before = mode.state, now = get(number);
    const double before_j = mode.energy_j, now_j = 0.5 * (now.v * now.v + mode.lambda * now.q * now.q);
    if (before_j == 0.0 && now_j == 0.0) continue;
    const bool is_alone = !is_coupled(number);
    double lost_j = 0.0;
    if (is_alone && acted && mode.omega_d > 0.0 && number / kGroup < groups) {
      lost_j = calc_lost_j(mode, kept[number / kGroup], number % kGroup, is_all);
    } else if (is_alone && acted) {  // near critical damping: as if the force had come at the end
      const double q = mode.alone.qq * before.q + mode.alone.qv * before.v, v = mode.alone.vq * before.q + mode.alone.vv * before.v;
      lost_j = before_j - 0.5 * (v * v + mode.lambda * q * q);
    } else if (is_alone && now_j > 0.0) {
      lost_j = before_j - now_j;
    } else if (passed > 0) {  // coupled, or silenced; under a force the amplitude changes evenly
      const double mean_j = acted ? (before_j + std::sqrt(before_j * now_j) + now_j) / 3.0 : before_j;
      lost_j = mean_j * (passed <= kSubBlocks ? mode.falls[passed - 1] : 1.0);
    }
    mode.state = now;
    mode.energy_j = now_j;
    sums_.radiated_j += mode.share * lost_j;
    if (!is_alone) {
      coupled_lost_j += lost_j;
      continue;
    }
    held_j += now_j;
    sums_.lost_j += acted ? lost_j : before_j - now_j;
    if (acted) sums_.given_j += now_j - before_j + lost_j;
  }
  sums_.lost_j += acted ? coupled_lost_j : coupled_j_ - coupled_j;
  if (acted) sums_.given_j += coupled_j - coupled_j_ + coupled_lost_j;
  coupled_j_ = coupled_j;
  sums_.held_j = held_j;
}

}  // namespace carillon::synth

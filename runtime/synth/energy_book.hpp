// Where the energy of the modes comes from and goes: what acts gives it, and damping takes it.
#pragma once

#include <array>
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
  double given_j = 0.0;     // by all that acts: pulses, forces, sliding and rolling; less what contacts that damp take
  double lost_j = 0.0;      // to damping, and with modes that were silenced
  double held_j = 0.0;      // at the moment
  double radiated_j = 0.0;  // of what is lost

  ModeEnergy& operator+=(const ModeEnergy& other) noexcept {
    given_j += other.given_j;
    lost_j += other.lost_j;
    held_j += other.held_j;
    radiated_j += other.radiated_j;
    return *this;
  }
};

/// The share of a mode's damping that is sound: d_r = bank::calc_radiation_decay(gain) of the bank's decay d, which counts as all there
/// is; 1 where d_r is more, as gains that radiation::limit_gains() has not limited may have it.
double calc_radiated_share(double gain, double decay_per_s) noexcept;

/// The book of one voice. What acts does so for whole sub-blocks: the states are noted before and after each, and at the start of each
/// block. A mode that nothing acts on loses what it has less; where something does, what it has more than it would have had alone, E, was
/// given evenly over the sub-block h, so that damping has taken a part of it already: given is E x / (1 - e^-x), x = 2 d h.
class EnergyBook {
 public:
  explicit EnergyBook(const Model& model);

  /// The states at a sample. `acted`: something did in the sub-block before it, whose beginning was noted. get(m): the state of a mode of
  /// the model; is_coupled(m): it is one of those that move together, with the
  /// energy `coupled_j`, whose damping is taken as that of linear modes.
  template <class Get, class IsCoupled>
  void note(std::int64_t sample, bool acted, const Get& get, const IsCoupled& is_coupled, double coupled_j) noexcept;
  /// Begins at these states, as if what they hold had been given before.
  template <class Get, class IsCoupled>
  void begin(std::int64_t sample, const ModeEnergy& before, const Get& get, const IsCoupled& is_coupled, double coupled_j) noexcept;

  const ModeEnergy& get() const noexcept { return sums_; }
  std::size_t calc_bytes() const noexcept { return modes_.capacity() * sizeof(Mode); }

 private:
  struct Mode {
    DampedState state;
    double lambda = 0.0, energy_j = 0.0, share = 0.0;  // share: that is radiated
    OscillatorMap alone{};                             // over a sub-block
    double factor = 1.0;                               // x / (1 - e^-x)
    std::array<double, kSubBlocks> falls{};            // 1 - e^-2 d t over one sub-block to a block
  };
  std::vector<Mode> modes_;
  std::int64_t sample_ = 0;
  double coupled_j_ = 0.0;
  ModeEnergy sums_;
};

template <class Get, class IsCoupled>
void EnergyBook::note(std::int64_t sample, bool acted, const Get& get, const IsCoupled& is_coupled, double coupled_j) noexcept {
  const std::int64_t passed = (sample - sample_) / kSubBlock;
  sample_ = sample;
  double held_j = coupled_j, coupled_lost_j = 0.0;
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    Mode& mode = modes_[m];
    const DampedState before = mode.state, now = get(static_cast<int>(m));
    const double before_j = mode.energy_j, now_j = 0.5 * (now.v * now.v + mode.lambda * now.q * now.q);
    mode.state = now;
    mode.energy_j = now_j;
    if (before_j == 0.0 && now_j == 0.0) continue;
    double fallen_j = 0.0;
    if (passed > 0) fallen_j = before_j * (passed <= kSubBlocks ? mode.falls[static_cast<std::size_t>(passed - 1)] : 1.0);
    sums_.radiated_j += mode.share * fallen_j;
    if (is_coupled(static_cast<int>(m))) {
      coupled_lost_j += fallen_j;
      continue;
    }
    held_j += now_j;
    if (!acted) {
      sums_.lost_j += before_j - now_j;
      continue;
    }
    const double q = mode.alone.qq * before.q + mode.alone.qv * before.v, v = mode.alone.vq * before.q + mode.alone.vv * before.v;
    const double alone_j = 0.5 * (v * v + mode.lambda * q * q), more_j = now_j - alone_j, given_j = more_j * mode.factor;
    sums_.given_j += given_j;
    sums_.lost_j += before_j - alone_j + given_j - more_j;
    sums_.radiated_j += mode.share * (given_j - more_j);
  }
  if (acted) {
    sums_.given_j += coupled_j - coupled_j_ + coupled_lost_j;
    sums_.lost_j += coupled_lost_j;
  } else {
    sums_.lost_j += coupled_j_ - coupled_j;
  }
  coupled_j_ = coupled_j;
  sums_.held_j = held_j;
}

template <class Get, class IsCoupled>
void EnergyBook::begin(std::int64_t sample, const ModeEnergy& before, const Get& get, const IsCoupled& is_coupled,
                       double coupled_j) noexcept {
  note(sample_, false, get, is_coupled, coupled_j);
  sample_ = sample;
  const double held_j = sums_.held_j;
  sums_ = before;
  // A model that lacks modes of the one before it, or has more: they go and come with their energy.
  sums_.lost_j += before.held_j - held_j;
  sums_.held_j = held_j;
}

}  // namespace carillon::synth

// Method:     each mode continues with the energy and phase of the mode of the same number in the bank. With q the amplitude and q' its
//             velocity, energy is (q'^2 + lambda q^2) / 2, so q' and sqrt(lambda) q are kept. The sound cross-fades over one block: the
//             free ringing of the old modes minus that of the new ones is added with a linear fall to zero; strikes act on the new modes
//             alone, from the first sample on.
// Source:     docs/equations.md E4, E6.
// Deviations: a body whose density or size changes keeps its energy: a convention, not physics. Damping is left out of the energy, as in
//             calc_energy_j().
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "runtime/synth/resonator_bank.hpp"

namespace carillon::synth {

ModeHandover::ModeHandover(const Model& from, const Model& to) {
  std::unordered_map<int, int> place;  // mode of `from` by number in the bank
  for (int m = 0; m < from.get_mode_count(); ++m) place.emplace(from.get_bank_mode(m), m);
  from_mode.reserve(to.get_mode_count());
  for (int m = 0; m < to.get_mode_count(); ++m) {
    const auto found = place.find(to.get_bank_mode(m));
    from_mode.push_back(found == place.end() ? -1 : found->second);
  }
  states.resize(to.get_sound_tables().size());
  damped.resize(to.get_damped_modes().size());
  old_damped.resize(from.get_damped_modes().size());
}

DampedState ResonatorBank::get_mode_state(int mode) const noexcept {
  if (mode >= model_->get_ringing_mode_count()) return damped_.get_states()[mode - model_->get_ringing_mode_count()];
  return is_coupled(mode) ? nonlinear_->get_state(nonlinear_->find_place(mode)) : ringing_.get_state(mode);
}

void ResonatorBank::set_mode_state(int mode, const DampedState& state) noexcept {
  if (mode >= model_->get_ringing_mode_count())
    damped_.set_state(static_cast<std::size_t>(mode - model_->get_ringing_mode_count()), state);
  else if (is_coupled(mode))
    nonlinear_->set_state(nonlinear_->find_place(mode), state);
  else
    ringing_.set_state(mode, state);
}

/// Adds `sign` times the free ringing over the next block; advances the states. `weights`: by which the modes sound to the ears of `fades`;
/// nullptr: to none.
void ResonatorBank::ring_out(std::span<ModeState> states, std::span<DampedState> damped, float sign, std::array<float, kBlock>& out,
                             const Directivity* weights, Directivity* fades) noexcept {
  const Kernels& kernels = ringing_.get_kernels();
  const SoundTable* table = model_->get_sound_tables().data();
  const RotationTable* turn = model_->get_rotation_tables().data();
  alignas(64) std::array<float, kBlock> sound{};
  const auto groups = static_cast<int>(states.size());
  if (groups > 0 && weights != nullptr) {
    kernels.advance(turn, states.data(), ringing_.get_starts(), groups);
    kernels.emit(table, ringing_.get_starts(), groups, 0, kSubBlocks, sound.data());
    fades->add_to_fade(kernels, *weights, ringing_.get_starts(), 0, groups, sign, false);
  } else if (groups > 0) {
    kernels.ring(table, turn, states.data(), groups, sound.data());
  }
  alignas(64) std::array<float, kBlock> overdamped{};
  for (std::size_t i = 0; i < damped.size(); ++i) {
    const auto& m = model_->get_damped_modes()[i];
    DampedState& s = damped[i];
    if (s.q == 0.0 && s.v == 0.0) continue;
    for (std::size_t n = 0; n < sound.size(); ++n) {
      s = {m.qq * s.q + m.qv * s.v, m.vq * s.q + m.vv * s.v};
      const auto p = static_cast<float>(m.gain * s.v);
      sound[n] += p;
      overdamped[n] += p;
    }
  }
  if (weights != nullptr) fades->add_damped_to_fade(*weights, overdamped.data(), sign);
  for (std::size_t n = 0; n < out.size(); ++n) out[n] += sign * sound[n];
}

void ResonatorBank::take_over(ResonatorBank& other, ModeHandover& handover) noexcept {
  horizon_ = other.horizon_;
  block_samples_ = unread_samples_ = 0;
  counters_ = other.counters_;
  bending_.take_over(other.bending_);
  const auto begin_book = [&] {
    if (!book_) return;
    book_->begin(
        horizon_, counters_.energy, [&](int m) { return get_mode_state(m); }, [&](int m) { return is_coupled(m); },
        nonlinear_ ? nonlinear_->calc_energy_j() : 0.0);
    counters_.energy = book_->get();
  };
  floor_pa_ = other.floor_pa_;
  strikes_.take_over(other.strikes_);
  fade_.fill(0.0F);
  fades_next_ = other.is_awake();
  if (!fades_next_) return begin_book();
  for (std::size_t m = 0; m < handover.from_mode.size(); ++m) {
    const int from = handover.from_mode[m], to = static_cast<int>(m);
    if (from < 0) continue;
    const DampedState old = other.get_mode_state(from);
    if (old.q == 0.0 && old.v == 0.0) continue;
    const double omega = std::sqrt(model_->get_eigenvalue_rad2_s2(to));
    const double q = old.q * std::sqrt(other.model_->get_eigenvalue_rad2_s2(from)) / omega;
    set_mode_state(to, {q, old.v});
  }
  begin_book();
  // In the fade coupled modes ring out linearly, in both objects; their additional sound begins with the first sample. Their lanes are then
  // put back to rest.
  if (other.nonlinear_)
    for (const int m : other.nonlinear_->get_modes()) other.ringing_.set_state(m, other.get_mode_state(m));
  if (nonlinear_)
    for (const int m : nonlinear_->get_modes()) ringing_.set_state(m, get_mode_state(m));
  const std::span<ModeState> states = ringing_.get_states();
  std::copy(other.damped_.get_states().begin(), other.damped_.get_states().end(), handover.old_damped.begin());
  // Copies are rung out; the states themselves begin the block.
  const bool directed = directed_ != nullptr && other.directed_ != nullptr;
  Directivity* ears = directed ? directed_ : nullptr;
  if (directed) ears->clear_fade();
  other.ring_out(other.ringing_.get_states(), handover.old_damped, 1.0F, fade_, directed ? other.directed_ : nullptr, ears);
  std::copy(states.begin(), states.end(), handover.states.begin());
  std::copy(damped_.get_states().begin(), damped_.get_states().end(), handover.damped.begin());
  if (nonlinear_)
    for (const int m : nonlinear_->get_modes()) ringing_.clear_state(m);
  ring_out(std::span(handover.states).first(states.size()), handover.damped, -1.0F, fade_, ears, ears);
  count_work(other.ringing_.get_ringing_groups() + ringing_.get_ringing_groups(), kBlock);
  for (int n = 0; n < kBlock; ++n) fade_[n] *= 1.0F - static_cast<float>(n) / kBlock;
  if (directed) ears->let_fade_fall();
}

}  // namespace carillon::synth

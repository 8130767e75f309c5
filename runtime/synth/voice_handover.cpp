// Method:     a voice takes the place of another that rings: each mode continues with the energy and the phase that the mode of the same
//             number in the bank had. With q the amplitude and q' its velocity, energy is (q'^2 + lambda q^2) / 2, so q' stays and
//             sqrt(lambda) q stays. The sound goes over within one block: what the old modes would have sounded, less what the new ones
//             sound, is added on its way from whole to nothing; strikes act on the new modes alone, from the first sample on.
// Source:     docs/equations.md E4, E6.
// Deviations: a body whose density or size changes keeps its energy, which no law of physics asks for: it is what a change without a blow
//             can mean. Damping is left out of the energy, as in calc_energy_j().
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "runtime/synth/voice.hpp"

namespace carillon::synth {

VoiceHandover::VoiceHandover(const Model& from, const Model& to) {
  std::unordered_map<int, int> place;  // of a mode of the bank in `from`
  for (int m = 0; m < from.get_mode_count(); ++m) place.emplace(from.get_bank_mode(m), m);
  from_mode_.reserve(to.get_mode_count());
  for (int m = 0; m < to.get_mode_count(); ++m) {
    const auto found = place.find(to.get_bank_mode(m));
    from_mode_.push_back(found == place.end() ? -1 : found->second);
  }
  states_.resize((static_cast<std::size_t>(to.get_ringing_mode_count()) + kGroup - 1) / kGroup);
  damped_.resize(to.get_damped_modes().size());
  old_damped_.resize(from.get_damped_modes().size());
}

DampedState Voice::get_mode_state(int mode) const noexcept {
  if (mode >= model_->ringing_) return damped_.get_states()[mode - model_->ringing_];
  if (const int place = is_nonlinear() ? nonlinear_->find_place(mode) : -1; place >= 0) return nonlinear_->get_state(place);
  const auto& m = model_->modes_[mode];
  const ModeState& state = state_[mode / kGroup];
  const double omega = std::sqrt(m.lambda);
  const double q = state.im[mode % kGroup] / std::sqrt((omega - m.decay) * (omega + m.decay));
  return {q, state.re[mode % kGroup] - m.decay * q};
}

void Voice::set_mode_state(int mode, const DampedState& state) noexcept {
  if (mode >= model_->ringing_) {
    damped_.set_state(static_cast<std::size_t>(mode - model_->ringing_), state);
    return;
  }
  if (const int place = is_nonlinear() ? nonlinear_->find_place(mode) : -1; place >= 0) {
    nonlinear_->set_state(place, state);
    return;
  }
  put_ringing_state(mode, state);
}

/// Into its lane of the groups.
void Voice::put_ringing_state(int mode, const DampedState& state) noexcept {
  const auto& m = model_->modes_[mode];
  ModeState& group = state_[mode / kGroup];
  const double omega = std::sqrt(m.lambda);
  group.re[mode % kGroup] = state.v + m.decay * state.q;
  group.im[mode % kGroup] = state.q * std::sqrt((omega - m.decay) * (omega + m.decay));
  live_ = std::max(live_, mode / kGroup + 1);
}

/// Adds `sign` times what the modes sound over the next block when nothing strikes them; the states advance.
/// `weights`: by which they sound to the ears of `fades`; nullptr: to none.
void Voice::ring_out(std::span<ModeState> states, std::span<DampedState> damped, float sign, std::array<float, kBlock>& out,
                     const Directivity* weights, Directivity* fades) noexcept {
  alignas(64) std::array<float, kBlock> sound{};
  const auto groups = static_cast<int>(states.size());
  const bool directed = kCompiledEffects.has(Effect::kDirectivity) && weights != nullptr;
  if (groups > 0 && directed) {
    kernels_->advance(model_->turn_.data(), states.data(), starts_.data(), groups);
    kernels_->emit(model_->sound_.data(), starts_.data(), groups, 0, kSubBlocks, sound.data());
    fades->add_to_fade(*kernels_, *weights, starts_.data(), 0, groups, sign, false);
  } else if (groups > 0) {
    kernels_->ring(model_->sound_.data(), model_->turn_.data(), states.data(), groups, sound.data());
  }
  alignas(64) std::array<float, kBlock> overdamped{};
  for (std::size_t i = 0; i < damped.size(); ++i) {
    const auto& m = model_->damped_[i];
    DampedState& s = damped[i];
    if (s.q == 0.0 && s.v == 0.0) continue;
    for (std::size_t n = 0; n < sound.size(); ++n) {
      s = {m.qq * s.q + m.qv * s.v, m.vq * s.q + m.vv * s.v};
      const auto p = static_cast<float>(m.gain * s.v);
      sound[n] += p;
      overdamped[n] += p;
    }
  }
  if (directed) fades->add_damped_to_fade(*weights, overdamped.data(), sign);
  for (std::size_t n = 0; n < out.size(); ++n) out[n] += sign * sound[n];
}

void Voice::take_over(Voice& other, VoiceHandover& handover) noexcept {
  horizon_ = other.horizon_;
  held_ = rendered_ = 0;
  counters_ = other.counters_;
  bending_.take_over(other.bending_);
  const auto begin_book = [&] {
    if (!book_) return;
    book_->begin(
        horizon_, counters_.energy, [&](int m) { return get_mode_state(m); },
        [&](int m) { return is_nonlinear() && nonlinear_->find_place(m) >= 0; }, is_nonlinear() ? nonlinear_->calc_energy_j() : 0.0);
    counters_.energy = book_->get();
  };
  floor_pa_ = other.floor_pa_;
  strikes_.take_over(other.strikes_);
  fade_.fill(0.0F);
  inherits_ = other.is_awake();
  if (!inherits_) return begin_book();
  for (std::size_t m = 0; m < handover.from_mode_.size(); ++m) {
    const int from = handover.from_mode_[m];
    if (from < 0) continue;
    const DampedState old = other.get_mode_state(from);
    if (old.q == 0.0 && old.v == 0.0) continue;
    const double omega = std::sqrt(model_->modes_[m].lambda);
    const double q = old.q * std::sqrt(other.model_->modes_[from].lambda) / omega;
    set_mode_state(static_cast<int>(m), {q, old.v});
  }
  begin_book();
  // Modes that are coupled ring out as those in groups do, in both voices: what one of them sounds beyond that is heard from the first
  // sample on. Their lanes are put back to rest.
  if (other.is_nonlinear())
    for (const int m : other.nonlinear_->get_modes()) other.put_ringing_state(m, other.get_mode_state(m));
  if (is_nonlinear())
    for (const int m : nonlinear_->get_modes()) put_ringing_state(m, get_mode_state(m));
  const std::size_t count = live_;
  std::copy(other.damped_.get_states().begin(), other.damped_.get_states().end(), handover.old_damped_.begin());
  // Copies are rung out; the states themselves begin the block.
  const bool directed = is_directed() && other.is_directed();
  Directivity* ears = directed ? directed_[0] : nullptr;
  if (directed) ears->clear_fade();
  other.ring_out(std::span(other.state_).first(other.live_), handover.old_damped_, 1.0F, fade_, directed ? other.directed_[0] : nullptr,
                 ears);
  std::copy_n(state_.begin(), count, handover.states_.begin());
  std::copy(damped_.get_states().begin(), damped_.get_states().end(), handover.damped_.begin());
  if (is_nonlinear())
    for (const int m : nonlinear_->get_modes()) state_[m / kGroup].re[m % kGroup] = state_[m / kGroup].im[m % kGroup] = 0.0;
  ring_out(std::span(handover.states_).first(count), handover.damped_, -1.0F, fade_, ears, ears);
  count_work(other.live_ + live_, kBlock);
  for (int n = 0; n < kBlock; ++n) fade_[n] *= 1.0F - static_cast<float>(n) / kBlock;
  if (directed) ears->let_fade_fall();
}

}  // namespace carillon::synth

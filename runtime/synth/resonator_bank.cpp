// Method:     modes ring by kernels.hpp, block by block. Linear modes: the response to a strike is that of modes at rest, over the
//             sub-blocks of its pulse, added to the ringing. Modes near and above critical damping are few and decay at once
//             (damped_modes.hpp). Inaudible groups are dropped from the end of the list, every eighth block.
// Source:     OSG02 section 4 (impulses to modes), corrected by its missing factor 1/2 in eq. 16-18; docs/equations.md E4 and E5.
#include "runtime/synth/resonator_bank.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/synth/fp_guard.hpp"

namespace carillon::synth {
namespace {

constexpr std::int64_t kCullEvery = 8;  // blocks
constexpr int kColumnsEach = kColumns / kSubBlocks;

bool acts_in_sub_block(const QueuedPulse& pulse, std::int64_t sample) noexcept {
  const double begin = pulse.begin - static_cast<double>(sample - 1);
  return begin <= kSubBlock && begin + pulse.length > 0.0;
}

}  // namespace

ResonatorBank::ResonatorBank(std::shared_ptr<const Model> model, ResonatorOptions options)
    : model_(std::move(model)),
      silence_pa_(options.silence_pa),
      strikes_(*model_, options.max_strikes, options.max_forces),
      ringing_(*model_, options.isa),
      damped_(*model_),
      bending_(*model_),
      kept_groups_(ringing_.get_model_groups()),
      contact_groups_(ringing_.get_model_groups()) {
  if (!(silence_pa_ > 0.0) || !std::isfinite(silence_pa_)) throw InputError("silence_pa must be a positive number");
  if (options.is_nonlinear) {
    if (model_->get_nonlinear() == nullptr) throw InputError("nonlinear: this bank has no nonlinear energy");
    if (options.has_cascade && !model_->has_cascade())
      throw InputError("a cascade needs a bank with a nonlinear energy, a mass, a thickness, and modes above the coupled ones");
    nonlinear_ = make_nonlinear_modes(*model_, options.has_cascade);
  }
  if (options.audits_energy) book_ = std::make_unique<EnergyBook>(*model_);
}

void ResonatorBank::process(std::span<float> pressure_pa) noexcept {
  const FpGuard guard;
  while (!pressure_pa.empty()) {
    if (unread_samples_ == 0) {
      const auto left = static_cast<int>((kBlock - horizon_ % kBlock) / kSubBlock);
      const std::size_t wanted = std::max<std::size_t>(1, pressure_pa.size() / kSubBlock);
      render(static_cast<int>(std::min<std::size_t>(left, wanted)));
    }
    const std::size_t count = std::min<std::size_t>(unread_samples_, pressure_pa.size());
    if (!silent_) {
      const float* from = block_.data() + (block_samples_ - unread_samples_);
      for (std::size_t n = 0; n < count; ++n) pressure_pa[n] += from[n];
    }
    unread_samples_ -= static_cast<int>(count);
    pressure_pa = pressure_pa.subspan(count);
  }
}

/// Fills block_ with the next `sub_blocks` sub-blocks, all of one block.
void ResonatorBank::render(int sub_blocks) noexcept {
  const std::int64_t start = horizon_;
  if (start % kBlock == 0) begin_block();
  horizon_ += sub_blocks * kSubBlock;
  block_samples_ = unread_samples_ = sub_blocks * kSubBlock;
  if (directed_ != nullptr) directed_->clear(block_samples_);
  if (sensors_ != nullptr) sensors_->begin(block_samples_);
  silent_ = !is_awake() && !fades_ && strikes_.is_empty() && (contacts_ == nullptr || contacts_->is_resting());
  if (silent_) return;
  const bool touched = contacts_ != nullptr && !contacts_->is_idle();
  std::fill(block_.begin(), block_.begin() + block_samples_, 0.0F);
  bool struck_at_all = false;
  for (int q = 0; q < sub_blocks; ++q) struck_at_all = struck_at_all || strikes_.acts(start + q * kSubBlock, kSubBlock);
  undisturbed_ = undisturbed_ && !struck_at_all && !touched;
  render_sub_blocks(start, sub_blocks, struck_at_all, touched);
  strikes_.finish(horizon_);
}

/// Decisions for the whole block, before its first sample.
void ResonatorBank::begin_block() noexcept {
  if (book_) audit();
  fades_ = std::exchange(fades_next_, false);
  const int keep = std::min(ringing_.get_max_groups(), kept_groups_);
  if (keep < ringing_.get_ringing_groups()) fade_out(keep);
  kept_groups_ = ringing_.get_model_groups();
  if (horizon_ / kBlock % kCullEvery != 0 || !is_awake()) return;
  const double share = silence_pa_ / static_cast<double>(ringing_.get_model_groups() + 1);
  ringing_.drop_below(share, get_weights());
  if (sensors_ == nullptr || !sensors_->reads_damped()) damped_.drop_below(share);
  if (nonlinear_) nonlinear_->drop_below(share);
}

/// Adds ringing modes and responses to forces to block_. Ringing modes are emitted up to the next sub-block with forces, which change the
/// following starts.
void ResonatorBank::render_sub_blocks(std::int64_t start, int sub_blocks, bool struck_at_all, bool touched) noexcept {
  const Kernels& kernels = ringing_.get_kernels();
  const auto first = static_cast<int>(start % kBlock / kSubBlock);
  const bool judged = model_->get_bending().thickness_m > 0.0;
  const bool watched = judged && bending_.is_watching();
  // The starts are needed for ears and sensors, and while the bending is watched.
  const bool whole = sub_blocks == kSubBlocks && !struck_at_all && !touched && directed_ == nullptr && sensors_ == nullptr && !watched;
  if (const int ringing = ringing_.get_ringing_groups(); ringing > 0 && whole) {
    kernels.ring(model_->get_sound_tables().data(), model_->get_rotation_tables().data(), ringing_.get_state_data(), ringing,
                 block_.data());
  } else if (ringing > 0 && first == 0) {
    kernels.advance(model_->get_rotation_tables().data(), ringing_.get_state_data(), ringing_.get_starts(), ringing);
  }
  for (int q = 0, made = whole ? sub_blocks : 0; q < sub_blocks; ++q) {
    const std::int64_t sample = start + q * kSubBlock;
    const SubBlock now{.sample = sample,
                       .index = first + q,
                       .struck = struck_at_all && strikes_.acts(sample, kSubBlock),
                       .drive = touched ? contacts_->begin_sub_block(sample) : nullptr,
                       .out = block_.data() + q * kSubBlock};
    const bool audited = book_ && (now.struck || now.drive != nullptr);
    if (audited) note_energy(sample, now.index * kColumnsEach);
    traces_for_book_ = audited;
    if (now.is_driven()) ringing_.wake(std::min(find_reach(now.drive->strength_n_s), contact_groups_));
    if (q == made) {
      do ++made;
      while (made < sub_blocks && !touched && !now.struck && !strikes_.acts(start + made * kSubBlock, kSubBlock));
      if (const int ringing = ringing_.get_ringing_groups(); ringing > 0 && !now.is_damped()) {
        kernels.emit(model_->get_sound_tables().data(), ringing_.get_starts(), ringing, now.index, made - q, now.out);
        if (directed_ != nullptr) directed_->emit(kernels, ringing_.get_starts(), ringing, now.index, made - q, q * kSubBlock);
        if (sensors_ != nullptr) sensors_->emit(kernels, ringing_.get_starts(), ringing, now.index, made - q, q * kSubBlock);
      }
    }
    render_forces(now, judged, audited);
    if (clear_if_not_finite(now)) break;
  }
}

/// Responses to forces and contacts, damped and coupled modes of one sub-block; watch of the bending and energy balance.
void ResonatorBank::render_forces(const SubBlock& now, bool judged, bool audited) noexcept {
  const int end_column = (now.index + 1) * kColumnsEach;
  add_forces(now);
  if (const bool acted = now.struck || now.is_driven(); judged && (acted || bending_.is_watching()))
    bending_.look(ringing_.get_state_data(), ringing_.get_starts(), end_column, ringing_.get_ringing_groups(), damped_.get_states(), acted);
  if (audited) note_energy_acted(now.sample + kSubBlock, end_column, now.is_damped());
  const int traced = std::exchange(traced_groups_, 0);
  if (directed_ != nullptr) add_directed(now, traced);
  if (sensors_ != nullptr) add_sensed(now, traced);
}

/// Clears the state, and the samples from this sub-block on, if the sub-block is not finite; true then.
bool ResonatorBank::clear_if_not_finite(const SubBlock& now) noexcept {
  int bad = 0;
  for (int n = 0; n < kSubBlock; ++n) bad |= static_cast<int>(!(std::abs(now.out[n]) <= std::numeric_limits<float>::max()));
  if (bad == 0) return false;
  reset();
  std::fill(now.out, block_.data() + block_samples_, 0.0F);
  if (directed_ != nullptr) directed_->silence(static_cast<int>(now.out - block_.data()));
  if (sensors_ != nullptr) sensors_->silence(static_cast<int>(now.out - block_.data()));
  return true;
}

/// Buffer for the trace of responses to forces in this sub-block, for ears, sensors and the energy book: all ringing groups, new ones
/// zeroed; nullptr if none needs it.
SampleStates* ResonatorBank::find_traced() noexcept {
  if (directed_ == nullptr && sensors_ == nullptr && !traces_for_book_) return nullptr;
  SampleStates* traced = directed_ != nullptr  ? directed_->get_kept().data()
                         : sensors_ != nullptr ? sensors_->get_kept()
                                               : book_->get_kept();
  for (; traced_groups_ < ringing_.get_ringing_groups(); ++traced_groups_) traced[traced_groups_] = SampleStates{};
  return traced;
}

/// Adds the responses to forces of a sub-block at the ears.
void ResonatorBank::add_directed(const SubBlock& now, int traced) noexcept {
  const int offset = static_cast<int>(now.out - block_.data());
  if (traced > 0) directed_->weigh(ringing_.get_kernels(), directed_->get_kept().data(), traced, now.index, offset);
  if (fades_) directed_->add_fade(now.index, offset);
}

/// Adds the responses to forces of a sub-block, damped modes and the forces themselves to the sensors. Modes that fade out are not read.
void ResonatorBank::add_sensed(const SubBlock& now, int traced) noexcept {
  const int offset = static_cast<int>(now.out - block_.data());
  const SampleStates* kept = directed_ != nullptr ? directed_->get_kept().data() : sensors_->get_kept();
  if (traced > 0) sensors_->weigh(ringing_.get_kernels(), kept, traced, offset);
  if (damped_.is_live()) sensors_->add_damped(offset);
  if (now.struck || now.is_driven()) sensors_->add_forces(strikes_, now.drive, now.sample, offset);
}

void ResonatorBank::add_damped(const SubBlock& now) noexcept {
  const ContactForces* contacts = now.is_driven() ? contacts_ : nullptr;
  if (!now.struck && contacts == nullptr && !damped_.is_live()) return;
  DampedState* states = sensors_ != nullptr ? sensors_->get_damped() : nullptr;
  if (directed_ == nullptr) return damped_.add(now.sample, strikes_, now.struck, contacts, now.out, states);
  alignas(64) std::array<float, kSubBlock> sound{};
  damped_.add(now.sample, strikes_, now.struck, contacts, sound.data(), states);
  for (std::size_t n = 0; n < sound.size(); ++n) now.out[n] += sound[n];
  if (damped_.is_live()) directed_->add_damped(sound.data(), now.index, static_cast<int>(now.out - block_.data()));
}

/// Coupled modes; at ears and sensors by the groups in which they would ring.
void ResonatorBank::add_nonlinear(const SubBlock& now) noexcept {
  if (!nonlinear_->is_live() && !now.struck && !now.is_driven()) return;
  if (directed_ != nullptr || sensors_ != nullptr) ringing_.wake(nonlinear_->get_group_count());
  SampleStates* traced = find_traced();
  nonlinear_->add(now.sample, strikes_, now.struck, now.drive, now.out, traced, ringing_.get_ringing_groups());
  counters_.coupled_samples += static_cast<std::int64_t>(nonlinear_->get_limit()) * kSubBlock;
  counters_.cascade_samples += static_cast<std::int64_t>(nonlinear_->get_cascade_count()) * kSubBlock;
}

/// Contacts, strikes, damped and coupled modes, and fade-outs of one sub-block.
void ResonatorBank::add_forces(const SubBlock& now) noexcept {
  if (const int ringing = ringing_.get_ringing_groups(); now.drive != nullptr && ringing > 0) {
    const Kernels& kernels = ringing_.get_kernels();
    const RotationTable* turn = model_->get_rotation_tables().data();
    if (SampleStates* traced = find_traced(); traced != nullptr)
      kernels.drive_and_keep(get_strike_tables(), turn, *now.drive, now.index, ringing_.get_state_data(), ringing_.get_starts(), ringing,
                             now.out, traced);
    else
      kernels.drive(get_strike_tables(), turn, *now.drive, now.index, ringing_.get_state_data(), ringing_.get_starts(), ringing, now.out);
    count_work(ringing, kSubBlock);
  }
  if (now.struck) {
    play_pulses(now);
    play_forces(now);
  }
  count_work(ringing_.get_ringing_groups(), kSubBlock);
  add_damped(now);
  if (nonlinear_) add_nonlinear(now);
  if (!fades_) return;
  for (int n = 0; n < kSubBlock; ++n) now.out[n] += fade_[now.index * kSubBlock + n];
}

/// Number of groups that a strike can lift above the floor.
int ResonatorBank::find_reach(float strength_n_s) const noexcept {
  if (!(floor_pa_ > 0.0F)) return ringing_.get_model_groups();
  const auto& reach = directed_ != nullptr ? model_->get_directivity()->reach : model_->get_reach();
  const auto last = std::partition_point(reach.begin(), reach.end(), [&](float pa) { return pa * strength_n_s >= floor_pa_; });
  return std::max(1, static_cast<int>(last - reach.begin()));
}

/// Samples of touch_: those of the sub-block with a non-zero force. Times since the sample before the sub-block.
void ResonatorBank::limit_touch(double begin, double end) noexcept {
  touch_.first = std::clamp(static_cast<int>(std::ceil(begin)) - 1, 0, kSubBlock);
  touch_.last = std::clamp(static_cast<int>(std::ceil(end)), touch_.first, kSubBlock);
}

void ResonatorBank::play_touch(const SubBlock& now) noexcept {
  const Kernels& kernels = ringing_.get_kernels();
  const RotationTable* turn = model_->get_rotation_tables().data();
  const int ringing = ringing_.get_ringing_groups();
  if (SampleStates* traced = find_traced(); traced != nullptr)
    kernels.strike_and_keep(get_strike_tables(), turn, touch_, now.index, ringing_.get_state_data(), ringing_.get_starts(), ringing,
                            now.out, traced);
  else
    kernels.strike(get_strike_tables(), turn, touch_, now.index, ringing_.get_state_data(), ringing_.get_starts(), ringing, now.out);
  count_work(ringing, kSubBlock);
}

void ResonatorBank::play_pulses(const SubBlock& now) noexcept {
  for (const QueuedPulse& pulse : strikes_.get_pulses())
    if (acts_in_sub_block(pulse, now.sample)) ringing_.wake(find_reach(pulse.strength_n_s));
  for (const QueuedPulse& pulse : strikes_.get_pulses()) {
    if (!acts_in_sub_block(pulse, now.sample)) continue;
    const double begin = pulse.begin - static_cast<double>(now.sample - 1);
    limit_touch(begin, begin + pulse.length);
    for (int n = touch_.first; n < touch_.last; ++n) {
      const Moments moments = calc_pulse_moments(pulse.shape, begin - n, pulse.length);
      for (int j = 0; j < kTerms; ++j) touch_.moment[n][j] = static_cast<float>(moments[j]);
    }
    std::copy(std::begin(pulse.row), std::end(pulse.row), touch_.row);
    std::copy(std::begin(pulse.weight), std::end(pulse.weight), touch_.weight);
    play_touch(now);
  }
}

/// Forces may be parts of one pulse, which only together lift a mode above the floor.
void ResonatorBank::play_forces(const SubBlock& now) noexcept {
  float strength_n_s = 0.0F;
  for (const QueuedForce& force : strikes_.get_forces()) strength_n_s += force.strength_n_s;
  for (const QueuedForce& force : strikes_.get_forces()) {
    if (!force.get_interval().overlaps(now.sample, kSubBlock)) continue;
    ringing_.wake(find_reach(strength_n_s));
    play_force(force, now);
  }
}

/// A pulse along each axis of the force.
void ResonatorBank::play_force(const QueuedForce& force, const SubBlock& now) noexcept {
  const double begin = force.begin - static_cast<double>(now.sample - 1);
  limit_touch(begin, force.calc_end() - static_cast<double>(now.sample - 1));
  std::array<ForceMoments, kSubBlock> moments;
  for (int n = touch_.first; n < touch_.last; ++n) moments[n] = calc_force_moments(force, begin - n, force.step);
  for (int axis = 0; axis < force.axes; ++axis) {
    model_->find_rows(force.triangle, touch_.row);
    force.find_weights(axis, touch_.weight);
    for (int n = touch_.first; n < touch_.last; ++n) {
      for (int j = 0; j < kTerms; ++j) touch_.moment[n][j] = static_cast<float>(moments[n][axis][j]);
    }
    play_touch(now);
  }
}

/// Renders the groups from `groups` on into the fade-out of the block that begins, and clears them.
void ResonatorBank::fade_out(int groups) noexcept {
  const Kernels& kernels = ringing_.get_kernels();
  const SoundTable* sound = model_->get_sound_tables().data() + groups;
  const RotationTable* turn = model_->get_rotation_tables().data() + groups;
  ModeState* states = ringing_.get_state_data() + groups;
  const int gone = ringing_.get_ringing_groups() - groups;
  if (!fades_) fade_.fill(0.0F);
  block_.fill(0.0F);  // not yet in use
  if (directed_ != nullptr) {
    ColumnStates* starts = ringing_.get_starts() + groups;
    kernels.advance(turn, states, starts, gone);
    kernels.emit(sound, starts, gone, 0, kSubBlocks, block_.data());
    if (!fades_) directed_->clear_fade();
    directed_->add_to_fade(kernels, *directed_, starts, groups, gone, 1.0F, true);
  } else {
    kernels.ring(sound, turn, states, gone, block_.data());
  }
  count_work(gone, kBlock);
  for (int n = 0; n < kBlock; ++n) fade_[n] += block_[n] * (1.0F - static_cast<float>(n) / kBlock);
  ringing_.truncate(groups);
  fades_ = true;
}

void ResonatorBank::set_max_modes(int modes) noexcept {
  const int groups = ringing_.get_model_groups();
  ringing_.set_max_groups(std::clamp((modes + kGroup - 1) / kGroup, std::min(1, groups), groups));
  if (!nonlinear_) return;
  // Coupling costs most: the limit leaves the same share of the coupled modes, the lowest.
  const double share = std::clamp(modes / static_cast<double>(std::max(1, model_->get_ringing_mode_count())), 0.0, 1.0);
  nonlinear_->set_limit(static_cast<int>(share * nonlinear_->get_coupled_count()));
}

/// At the start of a block: compares the energy with that of the previous block if no force acted in it.
void ResonatorBank::audit() noexcept {
  constexpr double kSmallestJ = 1e-280;  // below, squares are flushed to zero one by one
  const double before = std::exchange(energy_j_, calc_energy_j());
  if (undisturbed_ && before > kSmallestJ) counters_.energy_rise = std::max(counters_.energy_rise, energy_j_ / before - 1.0);
  undisturbed_ = true;
  if (before != 0.0 || energy_j_ != 0.0) note_energy(horizon_, kColumns);
}

/// State at the start of a column of this block; kColumns: of the next block.
DampedState ResonatorBank::get_state_at(int mode, int column) const noexcept {
  const bool is_now = column == kColumns || mode >= model_->get_ringing_mode_count() || is_coupled(mode);
  return is_now ? get_mode_state(mode) : ringing_.get_state_at(mode, column);
}

void ResonatorBank::note_energy(std::int64_t sample, int column) noexcept {
  book_->note(
      sample, [&](int m) { return get_state_at(m, column); }, [&](int m) { return is_coupled(m); },
      nonlinear_ ? nonlinear_->calc_energy_j() : 0.0);
  counters_.energy = book_->get();
}

/// After a sub-block with forces. `damps`: the trace has the whole states.
void ResonatorBank::note_energy_acted(std::int64_t sample, int column, bool damps) noexcept {
  book_->note_acted(
      sample, find_traced(), ringing_.get_ringing_groups(), damps, [&](int m) { return get_state_at(m, column); },
      [&](int m) { return is_coupled(m); }, nonlinear_ ? nonlinear_->calc_energy_j() : 0.0);
  counters_.energy = book_->get();
  traces_for_book_ = false;
}

void ResonatorBank::reset() noexcept {
  ringing_.reset();
  damped_.reset();
  if (nonlinear_) nonlinear_->reset();
  fades_ = fades_next_ = false;
  strikes_.clear();
  ++counters_.resets;
}

std::span<const std::array<float, kGroup>> ResonatorBank::get_weights() const noexcept {
  if (sensors_ != nullptr) return sensors_->get_weights();
  return directed_ != nullptr ? model_->get_directivity()->weight : model_->get_weights();
}

ResonatorCounters ResonatorBank::get_counters() const noexcept {
  ResonatorCounters counters = counters_;
  static_cast<StrikeCounters&>(counters) = strikes_.get_counters();
  counters.deflection = bending_.get_largest();
  return counters;
}

int ResonatorBank::get_active_mode_count() const {
  return (nonlinear_ && nonlinear_->is_live() ? nonlinear_->get_count() : 0) + ringing_.get_mode_count() +
         (damped_.is_live() ? static_cast<int>(damped_.get_count()) : 0);
}

void ResonatorBank::measure_amplitudes(std::span<float> by_bank_mode) const noexcept {
  const auto put = [&](int m, double amplitude) {
    const std::size_t at = model_->get_bank_mode(m);
    if (at < by_bank_mode.size()) by_bank_mode[at] = static_cast<float>(amplitude);
  };
  for (int m = 0; m < ringing_.get_mode_count(); ++m) put(m, ringing_.calc_amplitude(m));
  if (nonlinear_ && nonlinear_->is_live())
    for (const int m : nonlinear_->get_modes()) {
      const DampedState state = get_mode_state(m);
      const double omega_d = calc_damped_omega(*model_, m);
      put(m, std::hypot(state.v + model_->get_decay_per_s(m) * state.q, omega_d * state.q) / omega_d);
    }
  if (!damped_.is_live()) return;
  for (int m = model_->get_ringing_mode_count(); m < model_->get_mode_count(); ++m) put(m, std::abs(get_mode_state(m).q));
}

double ResonatorBank::calc_energy_j() const noexcept {
  return ringing_.calc_energy_j() + damped_.calc_energy_j() + (nonlinear_ ? nonlinear_->calc_energy_j() : 0.0);
}

}  // namespace carillon::synth

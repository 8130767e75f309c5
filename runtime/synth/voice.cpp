// Method:     the modes ring by kernels.hpp, block by block. A strike is worked out as the answer of modes at rest, over the sub-blocks
//             that its pulse touches, and added to what rings: the modes are linear. Modes near and above critical damping are few and die
//             at once (damped_modes.hpp). Groups of modes that cannot be heard any more are dropped from the end of the list, every eighth
//             block.
// Source:     OSG02 section 4 (impulses to modes), corrected by its missing factor 1/2 in eq. 16-18; docs/equations.md E4 and E5.
// Deviations: none.
#include "runtime/synth/voice.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/synth/fp_guard.hpp"

namespace carillon::synth {
namespace {

constexpr std::int64_t kCullEvery = 8;  // blocks

constexpr int kColumnsEach = kColumns / kSubBlocks;  // of a sub-block

bool acts_in_sub_block(const QueuedPulse& pulse, std::int64_t sample) noexcept {
  const double begin = pulse.begin - static_cast<double>(sample - 1);
  return begin <= kSubBlock && begin + pulse.length > 0.0;
}

}  // namespace

Voice::Voice(std::shared_ptr<const Model> model, VoiceOptions options)
    : model_(std::move(model)),
      kernels_(&get_kernels(options.isa)),
      silence_pa_(options.silence_pa),
      audits_(options.audits_energy),
      strikes_(*model_, options.max_strikes, options.max_forces),
      damped_(*model_),
      bending_(*model_) {
  if (!(silence_pa_ > 0.0) || !std::isfinite(silence_pa_)) throw InputError("the pressure of silence must be a positive number of Pa");
  groups_ = static_cast<int>(model_->sound_.size());
  limit_ = cut_ = driven_ = groups_;
  state_.resize(model_->sound_.size());
  starts_.resize(model_->sound_.size());
  bounds_.resize(model_->sound_.size());
  if (options.is_nonlinear) {
    if (model_->get_nonlinear() == nullptr)
      throw InputError("nonlinear motion needs a bank with a nonlinear energy, which this body's has not");
    if (options.has_cascade && !model_->has_cascade())
      throw InputError("a cascade needs a bank with a nonlinear energy, a mass, a thickness, and modes above the coupled ones");
    nonlinear_ = std::make_unique<NonlinearModes>(*model_, options.has_cascade);
  }
  if (audits_) book_ = std::make_unique<EnergyBook>(*model_);
}

void Voice::process(std::span<float> pressure_pa) noexcept {
  const FpGuard guard;
  while (!pressure_pa.empty()) {
    if (held_ == 0) {
      const auto left = static_cast<int>((kBlock - horizon_ % kBlock) / kSubBlock);
      const std::size_t wanted = std::max<std::size_t>(1, pressure_pa.size() / kSubBlock);
      render(static_cast<int>(std::min<std::size_t>(left, wanted)));
    }
    const std::size_t count = std::min<std::size_t>(held_, pressure_pa.size());
    if (!silent_) {
      const float* from = block_.data() + (rendered_ - held_);
      for (std::size_t n = 0; n < count; ++n) pressure_pa[n] += from[n];
    }
    held_ -= static_cast<int>(count);
    pressure_pa = pressure_pa.subspan(count);
  }
}

/// Fills block_ with the next `sub_blocks` sub-blocks, all of one block.
void Voice::render(int sub_blocks) noexcept {
  const std::int64_t start = horizon_;
  if (start % kBlock == 0) begin_block();
  horizon_ += sub_blocks * kSubBlock;
  rendered_ = held_ = sub_blocks * kSubBlock;
  if (is_directed()) for_directed([this](Directivity& ears) { ears.clear(rendered_); });
  silent_ = !is_awake() && !fading_ && strikes_.is_empty() && (contacts_ == nullptr || contacts_->is_resting());
  if (silent_) return;
  const bool touched = contacts_ != nullptr && !contacts_->is_idle();
  std::fill(block_.begin(), block_.begin() + rendered_, 0.0F);
  bool struck_at_all = false;
  for (int q = 0; q < sub_blocks; ++q) struck_at_all = struck_at_all || strikes_.acts(start + q * kSubBlock, kSubBlock);
  undisturbed_ = undisturbed_ && !struck_at_all && !touched;
  render_sub_blocks(start, sub_blocks, struck_at_all, touched);
  strikes_.finish(horizon_);
}

/// Before the first sample of a block: what is decided for all of it.
void Voice::begin_block() noexcept {
  if (audits_) audit();
  fading_ = std::exchange(inherits_, false);
  if (const int stay = std::min(limit_, cut_); stay < live_) fade_out(stay);
  cut_ = groups_;
  if (horizon_ / kBlock % kCullEvery == 0 && is_awake()) cull();
}

/// Adds to block_ what rings and what acts on it. What rings is emitted up to the next sub-block that is struck or touched, which changes
/// the starts after it.
void Voice::render_sub_blocks(std::int64_t start, int sub_blocks, bool struck_at_all, bool touched) noexcept {
  const auto first = static_cast<int>(start % kBlock / kSubBlock);
  const bool directed = is_directed();
  const bool judged = model_->bending_.thickness_m > 0.0;
  const bool watched = judged && bending_.is_watching();
  // The starts are kept for the ears, and where the bending is watched.
  const bool whole = sub_blocks == kSubBlocks && !struck_at_all && !touched && !directed && !watched;
  if (live_ > 0 && whole) {
    kernels_->ring(model_->sound_.data(), model_->turn_.data(), state_.data(), live_, block_.data());
  } else if (live_ > 0 && first == 0) {
    kernels_->advance(model_->turn_.data(), state_.data(), starts_.data(), live_);
  }
  for (int q = 0, made = whole ? sub_blocks : 0; q < sub_blocks; ++q) {
    float* out = block_.data() + q * kSubBlock;
    const std::int64_t sample = start + q * kSubBlock;
    const bool struck = struck_at_all && strikes_.acts(sample, kSubBlock);
    const ContactBlock* drive = touched ? contacts_->begin_sub_block(sample) : nullptr;
    const bool audited = audits_ && (struck || drive != nullptr);
    if (audited) note_energy(sample, (first + q) * kColumnsEach);
    keeps_for_book_ = audited;
    if (drive != nullptr && drive->forces) wake(std::min(find_reach(drive->strength_n_s), driven_));
    if (q == made) {
      do ++made;
      while (made < sub_blocks && !touched && !struck && !strikes_.acts(start + made * kSubBlock, kSubBlock));
      if (live_ > 0 && !(drive != nullptr && drive->damps)) {
        kernels_->emit(model_->sound_.data(), starts_.data(), live_, first + q, made - q, out);
        if (directed)
          for_directed([&](Directivity& ears) { ears.emit(*kernels_, starts_.data(), live_, first + q, made - q, q * kSubBlock); });
      }
    }
    add_acting(sample, first + q, drive, struck, out);
    if (const bool acted = struck || (drive != nullptr && drive->forces); judged && (acted || bending_.is_watching()))
      bending_.look(state_.data(), starts_.data(), (first + q + 1) * kColumnsEach, live_, damped_.get_states(), acted);
    if (audited) note_energy_acted(sample + kSubBlock, (first + q + 1) * kColumnsEach, drive != nullptr && drive->damps);
    if (directed) add_directed(first + q, q * kSubBlock);
    int bad = 0;
    for (int n = 0; n < kSubBlock; ++n) bad |= static_cast<int>(!(std::abs(out[n]) <= std::numeric_limits<float>::max()));
    if (bad != 0) {
      reset();
      std::fill(block_.begin() + q * kSubBlock, block_.begin() + rendered_, 0.0F);
      if (directed) for_directed([&](Directivity& ears) { ears.silence(q * kSubBlock); });
      break;
    }
  }
}

/// Buffer for the forces' part of the states in this sub-block, for the ears and the energy book: all live groups, new ones zeroed;
/// nullptr if neither needs it.
SampleStates* Voice::find_kept() noexcept {
  if (!is_directed() && !keeps_for_book_) return nullptr;
  SampleStates* kept = is_directed() ? directed_[0]->get_kept().data() : book_->get_kept();
  for (; kept_ < live_; ++kept_) kept[kept_] = SampleStates{};
  return kept;
}

/// What the ears hear in a sub-block in addition to what rings.
void Voice::add_directed(int sub_block, int offset) noexcept {
  const int groups = std::exchange(kept_, 0);
  for_directed([&](Directivity& ears) {
    if (groups > 0) ears.weigh(*kernels_, directed_[0]->get_kept().data(), groups, sub_block, offset);
    if (fading_) ears.add_fade(sub_block, offset);
  });
}

/// Of the modes that do not ring, where some do or may.
void Voice::add_damped(std::int64_t sample, bool struck, const ContactForces* contacts, int sub_block, float* out) noexcept {
  if (!is_directed()) return damped_.add(sample, strikes_, struck, contacts, out);
  alignas(64) std::array<float, kSubBlock> sound{};
  damped_.add(sample, strikes_, struck, contacts, sound.data());
  for (std::size_t n = 0; n < sound.size(); ++n) out[n] += sound[n];
  if (damped_.is_live())
    for_directed([&](Directivity& ears) { ears.add_damped(sound.data(), sub_block, static_cast<int>(out - block_.data())); });
}

/// Of the modes that large motion couples, where there are some: to the ears by the groups in which they would ring.
void Voice::add_nonlinear(std::int64_t sample, bool struck, const ContactBlock* drive, float* out) noexcept {
  if (!nonlinear_->is_live() && !struck && (drive == nullptr || !drive->forces)) return;
  if (is_directed()) wake(nonlinear_->get_group_count());
  nonlinear_->add(sample, strikes_, struck, drive, out, find_kept(), live_);
  counters_.coupled_samples += static_cast<std::int64_t>(nonlinear_->get_limit()) * kSubBlock;
  counters_.cascade_samples += static_cast<std::int64_t>(nonlinear_->get_cascade_count()) * kSubBlock;
}

/// What contacts and strikes add in one sub-block, with the damped modes and what fades out.
void Voice::add_acting(std::int64_t sample, int sub_block, const ContactBlock* drive, bool struck, float* out) noexcept {
  if (drive != nullptr && live_ > 0) {
    if (SampleStates* kept = find_kept(); kept != nullptr)
      kernels_->drive_and_keep(get_strike_tables(), model_->turn_.data(), *drive, sub_block, state_.data(), starts_.data(), live_, out,
                               kept);
    else
      kernels_->drive(get_strike_tables(), model_->turn_.data(), *drive, sub_block, state_.data(), starts_.data(), live_, out);
    count_work(live_, kSubBlock);
  }
  if (struck) {
    play_pulses(sample, sub_block, out);
    play_forces(sample, sub_block, out);
  }
  count_work(live_, kSubBlock);
  const bool driven = drive != nullptr && drive->forces;
  if (struck || driven || damped_.is_live()) add_damped(sample, struck, driven ? contacts_ : nullptr, sub_block, out);
  if (is_nonlinear()) add_nonlinear(sample, struck, drive, out);
  if (!fading_) return;
  for (int n = 0; n < kSubBlock; ++n) out[n] += fade_[sub_block * kSubBlock + n];
}

/// Makes as many groups live as the limit allows; the starts of those that were not are out of date.
void Voice::wake(int groups) noexcept {
  for (const int last = std::min(groups, limit_); live_ < last; ++live_) starts_[live_] = ColumnStates{};
}

/// Up to which group a strike can be heard above the floor.
int Voice::find_reach(float strength_n_s) const noexcept {
  if (!(floor_pa_ > 0.0F)) return groups_;
  const auto& reach = is_directed() ? model_->directivity_->reach : model_->reach_;
  const auto last = std::partition_point(reach.begin(), reach.end(), [&](float pa) { return pa * strength_n_s >= floor_pa_; });
  return std::max(1, static_cast<int>(last - reach.begin()));
}

/// The samples of touch_: those of the sub-block in which a force is not zero. Times since the sample before the sub-block.
void Voice::limit_touch(double begin, double end) noexcept {
  touch_.first = std::clamp(static_cast<int>(std::ceil(begin)) - 1, 0, kSubBlock);
  touch_.last = std::clamp(static_cast<int>(std::ceil(end)), touch_.first, kSubBlock);
}

void Voice::play_touch(int sub_block, float* out) noexcept {
  if (SampleStates* kept = find_kept(); kept != nullptr)
    kernels_->strike_and_keep(get_strike_tables(), model_->turn_.data(), touch_, sub_block, state_.data(), starts_.data(), live_, out,
                              kept);
  else
    kernels_->strike(get_strike_tables(), model_->turn_.data(), touch_, sub_block, state_.data(), starts_.data(), live_, out);
  count_work(live_, kSubBlock);
}

void Voice::play_pulses(std::int64_t sample, int sub_block, float* out) noexcept {
  for (const QueuedPulse& pulse : strikes_.get_pulses()) {
    if (acts_in_sub_block(pulse, sample)) wake(find_reach(pulse.strength_n_s));
  }
  for (const QueuedPulse& pulse : strikes_.get_pulses()) {
    if (!acts_in_sub_block(pulse, sample)) continue;
    const double begin = pulse.begin - static_cast<double>(sample - 1);
    limit_touch(begin, begin + pulse.length);
    for (int n = touch_.first; n < touch_.last; ++n) {
      const Moments moments = calc_pulse_moments(pulse.shape, begin - n, pulse.length);
      for (int j = 0; j < kTerms; ++j) touch_.moment[n][j] = static_cast<float>(moments[j]);
    }
    std::copy(std::begin(pulse.row), std::end(pulse.row), touch_.row);
    std::copy(std::begin(pulse.weight), std::end(pulse.weight), touch_.weight);
    play_touch(sub_block, out);
  }
}

/// Forces may be parts of one pulse, which only together lift a mode above the floor.
void Voice::play_forces(std::int64_t sample, int sub_block, float* out) noexcept {
  float strength_n_s = 0.0F;
  for (const QueuedForce& force : strikes_.get_forces()) strength_n_s += force.strength_n_s;
  for (const QueuedForce& force : strikes_.get_forces()) {
    if (!force.get_interval().overlaps(sample, kSubBlock)) continue;
    wake(find_reach(strength_n_s));
    play_force(force, sample, sub_block, out);
  }
}

/// A pulse along each direction of the force.
void Voice::play_force(const QueuedForce& force, std::int64_t sample, int sub_block, float* out) noexcept {
  const double begin = force.begin - static_cast<double>(sample - 1);
  limit_touch(begin, force.calc_end() - static_cast<double>(sample - 1));
  std::array<ForceMoments, kSubBlock> moments;
  for (int n = touch_.first; n < touch_.last; ++n) moments[n] = calc_force_moments(force, begin - n, force.step);
  for (int axis = 0; axis < force.axes; ++axis) {
    model_->find_rows(force.triangle, touch_.row);
    force.find_weights(axis, touch_.weight);
    for (int n = touch_.first; n < touch_.last; ++n) {
      for (int j = 0; j < kTerms; ++j) touch_.moment[n][j] = static_cast<float>(moments[n][axis][j]);
    }
    play_touch(sub_block, out);
  }
}

/// Drops groups from the end that cannot be heard any more.
void Voice::cull() noexcept {
#if defined(__wasm__)
  // No flush to zero there: a mode that dies away before its neighbours of a group would get down to denormal numbers. Ten million
  // times below what is dropped anyway.
  constexpr double kNothing = 1e-25;
  for (int g = 0; g < live_; ++g) {
    ModeState& state = state_[g];
    for (int lane = 0; lane < kGroup; ++lane) {
      if (std::abs(state.re[lane]) + std::abs(state.im[lane]) < kNothing) state.re[lane] = state.im[lane] = 0.0;
    }
  }
#endif
  const double share = silence_pa_ / static_cast<double>(groups_ + 1);
  const auto& weights = get_weights();
  for (; live_ > 0; --live_) {
    ModeState& state = state_[live_ - 1];
    const auto& weight = weights[live_ - 1];
    double bound = 0.0;
    for (int lane = 0; lane < kGroup; ++lane) {
      bound += static_cast<double>(weight[lane]) * std::sqrt(state.re[lane] * state.re[lane] + state.im[lane] * state.im[lane]);
    }
    if (bound >= share) break;
    state = ModeState{};
  }
  damped_.drop_below(share);
  if (is_nonlinear()) nonlinear_->drop_below(share);
}

std::span<const float> Voice::measure(float nearness) noexcept {
  float largest = 0.0F;
  const auto& weights = get_weights();
  for (int g = live_ - 1; g >= 0; --g) {
    const ModeState& state = state_[g];
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

/// Renders the groups from `groups` on once more, on their way out, for the block that begins.
void Voice::fade_out(int groups) noexcept {
  const int gone = live_ - groups;
  if (!fading_) fade_.fill(0.0F);
  block_.fill(0.0F);  // not yet in use
  if (is_directed()) {
    ColumnStates* starts = starts_.data() + groups;
    kernels_->advance(model_->turn_.data() + groups, state_.data() + groups, starts, gone);
    kernels_->emit(model_->sound_.data() + groups, starts, gone, 0, kSubBlocks, block_.data());
    for_directed([&](Directivity& ears) {
      if (!fading_) ears.clear_fade();
      ears.add_to_fade(*kernels_, ears, starts, groups, gone, 1.0F, true);
    });
  } else {
    kernels_->ring(model_->sound_.data() + groups, model_->turn_.data() + groups, state_.data() + groups, gone, block_.data());
  }
  count_work(gone, kBlock);
  for (int n = 0; n < kBlock; ++n) fade_[n] += block_[n] * (1.0F - static_cast<float>(n) / kBlock);
  std::fill(state_.begin() + groups, state_.begin() + live_, ModeState{});
  live_ = groups;
  fading_ = true;
}

void Voice::set_limit(int modes) noexcept {
  limit_ = std::clamp((modes + kGroup - 1) / kGroup, std::min(1, groups_), groups_);
  if (!is_nonlinear()) return;
  // Coupling costs the most: what a limit leaves of the modes it leaves of the coupled ones, the lowest.
  const double share = std::clamp(modes / static_cast<double>(std::max(1, model_->ringing_)), 0.0, 1.0);
  nonlinear_->set_limit(static_cast<int>(share * nonlinear_->get_coupled_count()));
}

/// At the start of a block: holds the energy against that of the block before, when nothing acted in it.
void Voice::audit() noexcept {
  constexpr double kSmallest = 1e-280;  // below, squares are flushed to zero one by one
  const double before = std::exchange(energy_j_, calc_energy_j());
  if (undisturbed_ && before > kSmallest) counters_.energy_rise = std::max(counters_.energy_rise, energy_j_ / before - 1.0);
  undisturbed_ = true;
  if (before != 0.0 || energy_j_ != 0.0) note_energy(horizon_, kColumns);
}

/// At the start of a column of this block; of the next for kColumns.
DampedState Voice::get_state_at(int m, int column) const noexcept {
  if (column == kColumns || m >= model_->ringing_ || (is_nonlinear() && nonlinear_->find_place(m) >= 0)) return get_mode_state(m);
  const std::size_t group = m / kGroup;
  if (m / kGroup >= live_) return {};
  const auto& mode = model_->modes_[m];
  const double omega = std::sqrt(mode.lambda), omega_d = std::sqrt((omega - mode.decay) * (omega + mode.decay));
  const double q = static_cast<double>(starts_[group].im[column][m % kGroup]) / omega_d;
  return {q, static_cast<double>(starts_[group].re[column][m % kGroup]) - mode.decay * q};
}

void Voice::note_energy(std::int64_t sample, int column) noexcept {
  book_->note(
      sample, [&](int m) { return get_state_at(m, column); }, [&](int m) { return is_nonlinear() && nonlinear_->find_place(m) >= 0; },
      is_nonlinear() ? nonlinear_->calc_energy_j() : 0.0);
  counters_.energy = book_->get();
}

/// After a sub-block with forces. `damps`: the buffer has the whole states.
void Voice::note_energy_acted(std::int64_t sample, int column, bool damps) noexcept {
  book_->note_acted(
      sample, find_kept(), live_, damps, [&](int m) { return get_state_at(m, column); },
      [&](int m) { return is_nonlinear() && nonlinear_->find_place(m) >= 0; }, is_nonlinear() ? nonlinear_->calc_energy_j() : 0.0);
  counters_.energy = book_->get();
  keeps_for_book_ = false;
  if (!is_directed()) kept_ = 0;
}

void Voice::reset() noexcept {
  std::fill(state_.begin(), state_.end(), ModeState{});
  damped_.reset();
  if (is_nonlinear()) nonlinear_->reset();
  live_ = 0;
  fading_ = inherits_ = false;
  strikes_.clear();
  ++counters_.resets;
}

VoiceCounters Voice::get_counters() const noexcept {
  VoiceCounters counters = counters_;
  static_cast<StrikeCounters&>(counters) = strikes_.get_counters();
  counters.deflection = bending_.get_largest();
  return counters;
}

int Voice::get_live_mode_count() const {
  return (is_nonlinear() && nonlinear_->is_live() ? nonlinear_->get_count() : 0) + std::min(live_ * kGroup, model_->ringing_) +
         (damped_.is_live() ? static_cast<int>(damped_.get_count()) : 0);
}

double Voice::calc_ringing_energy_j(int m) const noexcept {
  const auto& mode = model_->modes_[m];
  const ModeState& state = state_[m / kGroup];
  const double omega = std::sqrt(mode.lambda);
  const double q = state.im[m % kGroup] / std::sqrt((omega - mode.decay) * (omega + mode.decay));
  const double v = state.re[m % kGroup] - mode.decay * q;
  return 0.5 * (v * v + mode.lambda * q * q);
}

void Voice::measure_amplitudes(std::span<float> by_bank_mode) const noexcept {
  const int ringing = std::min(live_ * kGroup, model_->ringing_);
  const auto put = [&](int m, double amplitude) {
    const std::size_t at = model_->get_bank_mode(m);
    if (at < by_bank_mode.size()) by_bank_mode[at] = static_cast<float>(amplitude);
  };
  for (int m = 0; m < ringing; ++m) {
    const auto& mode = model_->modes_[m];
    const ModeState& state = state_[m / kGroup];
    const double omega = std::sqrt(mode.lambda);
    put(m, std::hypot(state.re[m % kGroup], state.im[m % kGroup]) / std::sqrt((omega - mode.decay) * (omega + mode.decay)));
  }
  if (is_nonlinear() && nonlinear_->is_live())
    for (const int m : nonlinear_->get_modes()) {
      const DampedState state = get_mode_state(m);
      const auto& mode = model_->modes_[m];
      const double omega = std::sqrt(mode.lambda), omega_d = std::sqrt((omega - mode.decay) * (omega + mode.decay));
      put(m, std::hypot(state.v + mode.decay * state.q, omega_d * state.q) / omega_d);
    }
  if (!damped_.is_live()) return;
  for (int m = model_->ringing_; m < model_->get_mode_count(); ++m) put(m, std::abs(get_mode_state(m).q));
}

double Voice::calc_energy_j() const noexcept {
  double energy = 0.0;
  for (int m = 0; m < std::min(live_ * kGroup, model_->ringing_); ++m) energy += calc_ringing_energy_j(m);
  return energy + damped_.calc_energy_j() + (is_nonlinear() ? nonlinear_->calc_energy_j() : 0.0);
}

}  // namespace carillon::synth

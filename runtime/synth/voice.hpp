// One body that rings: its modes, struck by contact pulses, summed to the pressure at 1 m.
//
//   synth::Voice voice(synth::Model::make(bank, {.rate_hz = 48000.0}));
//   voice.strike({.time_s = 0.0021, .triangle = 12, .barycentric = {0.2, 0.3, 0.5}, .impulse_n_s = {0, 0, 0.01}, .duration_s = 80e-6});
//   voice.process(block);  // adds pascals
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/synth/bending.hpp"
#include "runtime/synth/contact_forces.hpp"
#include "runtime/synth/damped_modes.hpp"
#include "runtime/synth/directivity.hpp"
#include "runtime/synth/energy_book.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/nonlinear_modes.hpp"
#include "runtime/synth/strike_queue.hpp"

namespace carillon::synth {

struct VoiceOptions {
  int max_strikes = 256;      // pulses that may be waiting or acting at once
  int max_forces = 256;       // events::Forces that may; a pulse of an impact is a few, a long one some dozens
  double silence_pa = 1e-10;  // below this bound on its pressure at 1 m (-106 dB re 20 uPa) a body sleeps
  Isa isa = Isa::kBest;
  bool is_nonlinear = false;   // coupled modes of the model move as Effect::kNonlinear has it
  bool has_cascade = false;    // and those above them as Effect::kCascade has it; only with is_nonlinear
  bool audits_energy = false;  // VoiceCounters::energy_rise and energy
};

struct VoiceCounters : StrikeCounters {
  std::int64_t resets = 0;           // times that the state was not finite and was cleared
  std::int64_t mode_samples = 0;     // work done: modes x samples, whole groups
  std::int64_t coupled_samples = 0;  // coupled modes x samples while they moved
  std::int64_t cascade_samples = 0;  // modes above them x samples, likewise
  double energy_rise = 0.0;          // the largest share by which the energy rose over a block in which nothing acted; 0 unless asked for
  double deflection = 0.0;           // the largest, in thicknesses; 0 while it has not been above kLinearThicknesses
  ModeEnergy energy;                 // zeros unless asked for
};

/// What a voice of one model needs to take the place of a voice of another.
class VoiceHandover {
 public:
  /// Modes are the same when they have the same number in the bank. [main-thread]
  VoiceHandover(const Model& from, const Model& to);
  /// By mode of `to`, that of `from`; -1: none.
  std::span<const int> get_old_modes() const noexcept { return from_mode_; }

 private:
  friend class Voice;
  std::vector<int> from_mode_;     // by mode of `to`; -1: a mode that `from` does not sound
  std::vector<ModeState> states_;  // room
  std::vector<DampedState> damped_, old_damped_;
};

/// All modes of a model below the Nyquist frequency. Invariant: the states are those at the horizon, a multiple of kSubBlock
/// samples from the first one; all that is decided is decided there, so that the same strikes give the same bits whatever the sizes of the
/// blocks; groups of modes beyond the live ones have no energy. Strikes wait in a StrikeQueue, modes that do not ring are DampedModes.
/// Memory is taken in the constructor only. One thread at a time.
class Voice {
 public:
  /// Throws InputError when the silence is not a positive number, and for nonlinear motion or a cascade that the model has
  /// not got.
  explicit Voice(std::shared_ptr<const Model> model, VoiceOptions options = {});

  /// Registers a pulse. Times are since the first sample of this voice; `body` and `other` of the impulse are not looked at. False when it
  /// was refused. [audio-thread]: no heap, no lock, no throw.
  bool strike(const events::Impulse& impulse) noexcept { return strikes_.push(impulse, horizon_); }

  /// The same for a force that is known step by step; played exactly.
  bool push(const events::Force& force) noexcept { return strikes_.push(force, horizon_); }

  /// Contacts that last act from the next sub-block on, or no more (nullptr). They must be of this voice's model and outlive their use.
  /// What is attached first hears of its first sample; release() before it is taken away, or a force is cut off. [audio-thread]
  void attach(ContactForces* contacts) noexcept { contacts_ = contacts; }

  /// What is sounded goes to the ears of these, too (nullptr: none), which must be of this voice's model, outlive their use and be at the
  /// weights of the block in which process() is called, whose calls then take whole sub-blocks of one block each. [audio-thread]
  void direct(Directivity* first, Directivity* second) noexcept { directed_ = {first, second}; }
  bool is_directed() const noexcept { return kCompiledEffects.has(Effect::kDirectivity) && directed_[0] != nullptr; }

  /// Adds the pressure at 1 m [Pa] of the next pressure_pa.size() samples. A body without energy costs nothing.
  /// Denormal numbers are flushed to zero inside; the caller's setting is put back.
  /// [audio-thread]: no heap, no lock, no throw.
  void process(std::span<float> pressure_pa) noexcept;

  /// Plays at most this many modes, rounded up to whole groups of kGroup and at least one, the most audible; from the next multiple of
  /// kBlock samples on. Those that it takes away fade out over kBlock samples. [audio-thread]
  void set_limit(int modes) noexcept;

  /// How much there is to hear of each live group at this moment: a bound on the pressure [Pa] at the distance where 1 Pa at 1 m is
  /// `nearness` pascals, of this group or of a later one, whichever is larger, so that they never grow along the list. At a multiple of
  /// kBlock samples only; good until the next call. [audio-thread]
  std::span<const float> measure(float nearness) noexcept;
  std::span<const float> get_measured() const noexcept { return std::span(bounds_).first(live_); }

  /// Lets the live groups from `groups` on fade out over the block that begins; strikes may wake them again, contacts that last only after
  /// allow_driven(). At least one stays. At a multiple of kBlock samples only. [audio-thread]
  void cut(int groups) noexcept { cut_ = driven_ = std::max(1, groups); }

  /// Lets contacts that last drive so many groups more than they may. [audio-thread]
  void allow_driven(int more) noexcept { driven_ = std::min(groups_, driven_ + more); }

  /// From now on a strike wakes only groups that it could lift to this pressure at 1 m [Pa], those before them in the list, and the first;
  /// 0, as at first: all. [audio-thread]
  void set_floor(float pressure_pa) noexcept { floor_pa_ = pressure_pa; }

  /// Takes the place of another voice: at its time, with its strikes, each mode with the energy and the phase of its predecessor. The
  /// sound goes over within a block. At the start of a block of the other voice, which is of no more use afterwards; of a voice that is
  /// as it was made. A strike under way on a triangle that the model has not is refused. What the other one sends to ears is faded over
  /// for those of this one, which have taken over the weights. [audio-thread]
  void take_over(Voice& other, VoiceHandover& handover) noexcept;

  /// Sounds to the ears to which another voice of the same model does. [audio-thread]
  void direct_as(const Voice& other) noexcept { directed_ = other.directed_; }

  /// Samples processed so far: the number of the next sample.
  std::int64_t get_position() const { return horizon_ - held_; }
  /// The first sample that a new strike can still reach: less than kSubBlock samples ahead of the position unless calls ask for whole
  /// sub-blocks.
  std::int64_t get_horizon() const { return horizon_; }
  const Model& get_model() const { return *model_; }
  /// Modes that are advanced at this moment, in whole groups.
  int get_live_mode_count() const;
  int get_live_group_count() const { return live_; }
  int get_group_count() const { return groups_; }
  bool is_awake() const { return live_ > 0 || damped_.is_live() || (is_nonlinear() && nonlinear_->is_live()); }
  bool is_nonlinear() const noexcept { return nonlinear_ != nullptr; }
  /// Modes that are coupled at this moment, of those that the model couples: fewer under a limit.
  int get_coupled_count() const noexcept { return is_nonlinear() ? nonlinear_->get_limit() : 0; }
  /// Nothing sounds, nothing is to come and nothing is left in the block: process() would only give zeros.
  bool is_idle() const {
    return !is_awake() && !fading_ && !inherits_ && strikes_.is_empty() && held_ == 0 && (contacts_ == nullptr || contacts_->is_resting());
  }
  /// Advances an idle voice by a multiple of kSubBlock samples without output. [audio-thread]
  void skip(std::int64_t samples) noexcept { horizon_ += samples; }
  VoiceCounters get_counters() const noexcept;
  /// Fills in the amplitude of q [m kg^1/2] of each mode that rings, by number in the bank, where there is room for it. [audio-thread]
  void measure_amplitudes(std::span<float> by_bank_mode) const noexcept;
  /// Sum over the sounded modes of (q'^2 + lambda q^2) / 2 [J] at the horizon, which must be a multiple of kBlock.
  double calc_energy_j() const noexcept;

 private:
  void render(int sub_blocks) noexcept;
  void begin_block() noexcept;
  void render_sub_blocks(std::int64_t start, int sub_blocks, bool struck_at_all, bool touched) noexcept;
  void add_acting(std::int64_t sample, int sub_block, const ContactBlock* drive, bool struck, float* out) noexcept;
  void wake(int groups) noexcept;
  int find_reach(float strength_n_s) const noexcept;
  void play_pulses(std::int64_t sample, int sub_block, float* out) noexcept;
  void play_forces(std::int64_t sample, int sub_block, float* out) noexcept;
  void play_force(const QueuedForce& force, std::int64_t sample, int sub_block, float* out) noexcept;
  void play_touch(int sub_block, float* out) noexcept;
  void limit_touch(double begin, double end) noexcept;
  void count_work(int groups, int samples) noexcept { counters_.mode_samples += static_cast<std::int64_t>(groups) * kGroup * samples; }
  void cull() noexcept;
  void fade_out(int groups) noexcept;
  void reset() noexcept;
  void audit() noexcept;
  void note_energy(std::int64_t sample, int column) noexcept;
  void note_energy_acted(std::int64_t sample, int column, bool damps) noexcept;
  DampedState get_state_at(int mode, int column) const noexcept;
  double calc_ringing_energy_j(int mode) const noexcept;
  DampedState get_mode_state(int mode) const noexcept;
  void set_mode_state(int mode, const DampedState& state) noexcept;
  void put_ringing_state(int mode, const DampedState& state) noexcept;
  void ring_out(std::span<ModeState> states, std::span<DampedState> damped, float sign, std::array<float, kBlock>& out,
                const Directivity* weights, Directivity* fades) noexcept;
  template <class Work>
  void for_directed(Work&& work) noexcept {
    for (Directivity* ears : directed_)
      if (ears != nullptr) work(*ears);
  }
  SampleStates* find_kept() noexcept;
  void add_directed(int sub_block, int offset) noexcept;
  void add_damped(std::int64_t sample, bool struck, const ContactForces* contacts, int sub_block, float* out) noexcept;
  void add_nonlinear(std::int64_t sample, bool struck, const ContactBlock* drive, float* out) noexcept;
  const StrikeTable* get_strike_tables() const noexcept {
    return is_nonlinear() ? nonlinear_->get_strike_tables() : model_->strike_.data();
  }
  const std::vector<std::array<float, kGroup>>& get_weights() const noexcept {
    return is_directed() ? model_->directivity_->weight : model_->weight_;
  }

  std::shared_ptr<const Model> model_;
  const Kernels* kernels_ = nullptr;
  double silence_pa_ = 0.0;
  int groups_ = 0;  // of the model
  int limit_ = 0;   // groups that may be played
  int live_ = 0;    // groups that are; those behind have no energy
  int cut_ = 0;     // groups that stay when the next block begins
  int driven_ = 0;  // groups that contacts may wake
  float floor_pa_ = 0.0F;
  bool fading_ = false;       // fade_ holds what goes in this block: what the limit took away, what another model sounded
  bool inherits_ = false;     // fade_ is filled for the block that begins
  std::int64_t horizon_ = 0;  // samples rendered
  int held_ = 0;              // of them not yet handed out: the last of block_
  int rendered_ = 0;          // samples in block_
  bool silent_ = true;        // block_ is all zero
  bool audits_ = false, undisturbed_ = false, keeps_for_book_ = false;
  double energy_j_ = 0.0;             // at the start of the block, where it is audited
  std::unique_ptr<EnergyBook> book_;  // where it is audited
  ContactForces* contacts_ = nullptr;
  std::array<Directivity*, 2> directed_{};  // the first is there when one is
  int kept_ = 0;                            // groups whose states are kept in this sub-block
  VoiceCounters counters_;                  // without those of strikes_
  StrikeQueue strikes_;
  DampedModes damped_;
  BendingWatch bending_;
  std::unique_ptr<NonlinearModes> nonlinear_;  // or none
  std::vector<ModeState> state_;               // zero beyond live_
  std::vector<ColumnStates> starts_;           // out of date beyond live_, and once a whole block was rendered
  std::vector<float> bounds_;                  // of measure()
  PulseBlock touch_;
  alignas(64) std::array<float, kBlock> block_{}, fade_{};
};

}  // namespace carillon::synth

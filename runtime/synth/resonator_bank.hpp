// All modes of one body as a bank of resonators, excited by pulses, forces and lasting contacts; their pressure at 1 m.
//
//   synth::ResonatorBank modes(synth::Model::make(bank, {.rate_hz = 48000.0}));
//   modes.strike({.time_s = 0.0021, .triangle = 12, .barycentric = {0.2, 0.3, 0.5}, .impulse_n_s = {0, 0, 0.01}, .duration_s = 80e-6});
//   modes.process(block);  // adds pascals
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
#include "runtime/synth/ringing_modes.hpp"
#include "runtime/synth/sensor.hpp"
#include "runtime/synth/strike_queue.hpp"

namespace carillon::synth {

struct ResonatorOptions {
  int max_strikes = 256;      // waiting or active pulses
  int max_forces = 256;       // waiting or active events::Forces; a few per impact, dozens for long pulses
  double silence_pa = 1e-10;  // pressure bound at 1 m (-106 dB re 20 uPa) below which the modes sleep
  Isa isa = Isa::kBest;
  bool is_nonlinear = false;   // Effect::kNonlinear
  bool has_cascade = false;    // Effect::kCascade; only with is_nonlinear
  bool audits_energy = false;  // ResonatorCounters::energy_rise and energy
};

struct ResonatorCounters : StrikeCounters {
  std::int64_t resets = 0;           // non-finite states cleared
  std::int64_t mode_samples = 0;     // work: modes x samples, whole groups
  std::int64_t coupled_samples = 0;  // coupled modes x samples in motion
  std::int64_t cascade_samples = 0;  // modes above them x samples in motion
  double energy_rise = 0.0;          // largest relative rise of the energy over a block without forces; only with audits_energy
  double deflection = 0.0;           // largest deflection in thicknesses; 0 up to kLinearThicknesses
  ModeEnergy energy;                 // only with audits_energy
};

/// Mapping and buffers by which the modes of one model replace those of another. Modes correspond by their number in the bank.
/// [main-thread]
struct ModeHandover {
  ModeHandover(const Model& from, const Model& to);

  std::vector<int> from_mode;     // per mode of `to`: mode of `from`; -1: none
  std::vector<ModeState> states;  // buffers
  std::vector<DampedState> damped, old_damped;
};

/// All modes of a model below the Nyquist frequency. Invariant: the states are those at the horizon, a multiple of kSubBlock samples from
/// the first one; all decisions are made there, so the bits do not depend on the block sizes. Allocates in the constructor only. One thread
/// at a time. All functions but the constructor: [audio-thread], no heap, no lock, no throw.
class ResonatorBank {
 public:
  /// Throws InputError unless silence_pa is positive, and for nonlinear motion or a cascade that the model does not have.
  explicit ResonatorBank(std::shared_ptr<const Model> model, ResonatorOptions options = {});

  /// Queues a pulse. Times since the first sample; `body` and `other` are ignored. False if refused.
  bool strike(const events::Impulse& impulse) noexcept { return strikes_.push(impulse, horizon_); }

  /// Queues a force known step by step.
  bool push(const events::Force& force) noexcept { return strikes_.push(force, horizon_); }

  /// Lasting contacts from the next sub-block on (nullptr: none), for the same model; they must outlive their use.
  void attach(ContactForces* contacts) noexcept { contacts_ = contacts; }

  /// Also renders to the ears of `ears` (nullptr: none), for the same model; it must outlive its use and have the weights of the block in
  /// which process() is called, whose calls then take whole sub-blocks within one block.
  void direct(Directivity* ears) noexcept { directed_ = ears; }

  /// Also gives the readings of these sensors (nullptr: none), for the same model, under the conditions of direct().
  void sense(BodySensors* sensors) noexcept { sensors_ = sensors; }

  /// Adds the pressure at 1 m [Pa] of the next pressure_pa.size() samples. Free without energy. Flushes denormal numbers inside.
  void process(std::span<float> pressure_pa) noexcept;

  /// Plays at most this many modes, rounded up to whole groups of kGroup and at least one, the most audible; from the next multiple of
  /// kBlock samples on. Removed groups fade out over kBlock samples.
  void set_max_modes(int modes) noexcept;

  /// RingingModes::measure() at a multiple of kBlock samples. `nearness`: pascals for 1 Pa at 1 m.
  std::span<const float> measure(float nearness) noexcept { return ringing_.measure(nearness, get_weights()); }
  std::span<const float> get_measured() const noexcept { return ringing_.get_measured(); }

  /// Fades out the ringing groups from `groups` on over the block that begins; strikes may wake them again, lasting contacts only after
  /// allow_contacts(). Keeps at least one. At a multiple of kBlock samples only.
  void truncate(int groups) noexcept { kept_groups_ = contact_groups_ = std::max(1, groups); }

  /// Lets lasting contacts drive this many groups more.
  void allow_contacts(int more) noexcept { contact_groups_ = std::min(ringing_.get_model_groups(), contact_groups_ + more); }

  /// Strikes wake only groups that they could lift to this pressure at 1 m [Pa], those before them in the list, and the first; 0: all.
  void set_floor(float pressure_pa) noexcept { floor_pa_ = pressure_pa; }

  /// Replaces another object, at the start of its block: takes over its time and strikes, and each mode with the energy and phase of its
  /// predecessor; the sound cross-fades over the block, also to the ears of both, whose weights must be taken over before. This object must
  /// be new; the other one is then unused. Strikes on missing triangles are refused.
  void take_over(ResonatorBank& other, ModeHandover& handover) noexcept;

  /// Samples processed so far.
  std::int64_t get_position() const { return horizon_ - unread_samples_; }
  /// First sample that a new strike can reach: less than kSubBlock samples ahead of the position, unless calls ask for whole sub-blocks.
  std::int64_t get_horizon() const { return horizon_; }
  const Model& get_model() const { return *model_; }
  /// Modes being rendered, in whole groups.
  int get_active_mode_count() const;
  int get_ringing_group_count() const { return ringing_.get_ringing_groups(); }
  int get_group_count() const { return ringing_.get_model_groups(); }
  bool is_awake() const { return ringing_.get_ringing_groups() > 0 || damped_.is_live() || (nonlinear_ && nonlinear_->is_live()); }
  /// Modes coupled now: fewer under a limit.
  int get_coupled_count() const noexcept { return nonlinear_ ? nonlinear_->get_limit() : 0; }
  /// True while process() would only add zeros.
  bool is_idle() const {
    return !is_awake() && !fades_ && !fades_next_ && strikes_.is_empty() && unread_samples_ == 0 &&
           (contacts_ == nullptr || contacts_->is_resting());
  }
  /// Advances an idle object by a multiple of kSubBlock samples without output.
  void skip(std::int64_t samples) noexcept { horizon_ += samples; }
  ResonatorCounters get_counters() const noexcept;
  /// Writes the amplitude of q [m kg^1/2] of each moving mode, by number in the bank, as far as there is space.
  void measure_amplitudes(std::span<float> by_bank_mode) const noexcept;
  /// Sum over modes of (q'^2 + lambda q^2) / 2 [J] at the horizon, which must be a multiple of kBlock.
  double calc_energy_j() const noexcept;

 private:
  /// Forces of one sub-block.
  struct SubBlock {
    std::int64_t sample = 0;
    int index = 0;                        // within the block
    bool struck = false;                  // a pulse or a force acts
    const ContactBlock* drive = nullptr;  // lasting contacts
    float* out = nullptr;
    bool is_driven() const noexcept { return drive != nullptr && drive->forces; }
    bool is_damped() const noexcept { return drive != nullptr && drive->damps; }
  };

  void render(int sub_blocks) noexcept;
  void begin_block() noexcept;
  void render_sub_blocks(std::int64_t start, int sub_blocks, bool struck_at_all, bool touched) noexcept;
  void render_forces(const SubBlock& now, bool judged, bool audited) noexcept;
  bool clear_if_not_finite(const SubBlock& now) noexcept;
  void add_forces(const SubBlock& now) noexcept;
  void play_pulses(const SubBlock& now) noexcept;
  void play_forces(const SubBlock& now) noexcept;
  void play_force(const QueuedForce& force, const SubBlock& now) noexcept;
  void play_touch(const SubBlock& now) noexcept;
  void limit_touch(double begin, double end) noexcept;
  void add_damped(const SubBlock& now) noexcept;
  void add_nonlinear(const SubBlock& now) noexcept;
  void add_directed(const SubBlock& now, int traced) noexcept;
  void add_sensed(const SubBlock& now, int traced) noexcept;
  int find_reach(float strength_n_s) const noexcept;
  void fade_out(int groups) noexcept;
  void reset() noexcept;
  void audit() noexcept;
  void note_energy(std::int64_t sample, int column) noexcept;
  void note_energy_acted(std::int64_t sample, int column, bool damps) noexcept;
  bool is_coupled(int mode) const noexcept { return nonlinear_ && nonlinear_->find_place(mode) >= 0; }
  DampedState get_state_at(int mode, int column) const noexcept;
  DampedState get_mode_state(int mode) const noexcept;
  void set_mode_state(int mode, const DampedState& state) noexcept;
  void ring_out(std::span<ModeState> states, std::span<DampedState> damped, float sign, std::array<float, kBlock>& out,
                const Directivity* weights, Directivity* fades) noexcept;
  SampleStates* find_traced() noexcept;
  void count_work(int groups, int samples) noexcept { counters_.mode_samples += static_cast<std::int64_t>(groups) * kGroup * samples; }
  std::span<const std::array<float, kGroup>> get_weights() const noexcept;
  const StrikeTable* get_strike_tables() const noexcept {
    return nonlinear_ ? nonlinear_->get_strike_tables() : model_->get_strike_tables().data();
  }

  std::shared_ptr<const Model> model_;
  double silence_pa_ = 0.0;
  StrikeQueue strikes_;
  RingingModes ringing_;
  DampedModes damped_;
  std::unique_ptr<NonlinearModes> nonlinear_;  // only if is_nonlinear
  ContactForces* contacts_ = nullptr;
  Directivity* directed_ = nullptr;
  BodySensors* sensors_ = nullptr;
  BendingWatch bending_;
  std::unique_ptr<EnergyBook> book_;  // only with audits_energy
  int kept_groups_ = 0;               // ringing groups allowed at the start of the next block
  int contact_groups_ = 0;            // groups that lasting contacts may wake
  int traced_groups_ = 0;             // groups with a trace of their response in this sub-block, find_traced()
  float floor_pa_ = 0.0F;
  bool fades_ = false;            // fade_ sounds in this block: removed groups, the modes of a replaced model
  bool fades_next_ = false;       // fade_ is for the next block
  std::int64_t horizon_ = 0;      // rendered samples
  int block_samples_ = 0;         // samples in block_
  int unread_samples_ = 0;        // last samples of block_, not yet output
  bool silent_ = true;            // block_ is zero
  bool undisturbed_ = false;      // no force in this block so far
  bool traces_for_book_ = false;  // the energy book needs the trace of this sub-block
  double energy_j_ = 0.0;         // at the start of the block, with audits_energy
  ResonatorCounters counters_;    // without those of strikes_
  PulseBlock touch_;
  alignas(64) std::array<float, kBlock> block_{}, fade_{};
};

}  // namespace carillon::synth

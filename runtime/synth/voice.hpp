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

#include "runtime/stream/events.hpp"
#include "runtime/synth/contact_forces.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/pulse.hpp"

namespace carillon::synth {

struct VoiceOptions {
  int max_strikes = 256;      // pulses that may be waiting or acting at once
  int max_forces = 256;       // stream::Forces that may; a pulse of an impact is a few, a long one some dozens
  double silence_pa = 1e-10;  // below this bound on its pressure at 1 m (-106 dB re 20 uPa) a body sleeps
  Isa isa = Isa::kBest;
  bool audits_energy = false;  // VoiceCounters::energy_rise and radiated_j
};

struct VoiceCounters {
  std::int64_t accepted = 0;      // strikes taken
  std::int64_t refused = 0;       // not finite, outside the surface, or no room
  std::int64_t late = 0;          // began before the horizon and were moved there
  std::int64_t resets = 0;        // times that the state was not finite and was cleared
  std::int64_t mode_samples = 0;  // work done: modes x samples, whole groups
  double energy_rise = 0.0;       // the largest share by which the energy rose over a period in which nothing acted; 0 unless asked for
  double radiated_j = 0.0;        // share of what damping took from what rang at the start of each period; 0 unless asked for
};

/// The share of a mode's damping that is sound: d_r = bank::calc_radiation_decay(gain) of the bank's decay d, which counts as all there
/// is; 1 where d_r is more, as gains that radiation::limit_gains() has not limited may have it.
double calc_radiated_share(double gain, double decay_per_s) noexcept;

/// A mode at or near critical damping: amplitude and velocity.
struct DampedState {
  double q = 0.0, v = 0.0;
};

/// What a voice of one model needs to take the place of a voice of another.
class Succession {
 public:
  /// Modes are the same when they have the same number in the bank. [main-thread]
  Succession(const Model& from, const Model& to);

 private:
  friend class Voice;
  std::vector<int> from_mode_;     // by mode of `to`; -1: a mode that `from` does not sound
  std::vector<ModeState> states_;  // room
  std::vector<DampedState> damped_;
};

/// All modes of a model below the Nyquist frequency. Time runs on a grid of kQuantum samples from the first one: what is decided is decided
/// on the grid, so that the same strikes give the same bits whatever the sizes of the blocks. Memory is taken in the constructor only.
/// One thread at a time.
class Voice {
 public:
  /// Throws InputError when the silence is not a positive number.
  explicit Voice(std::shared_ptr<const Model> model, VoiceOptions options = {});

  /// Registers a pulse. Times are since the first sample of this voice; `body` and `other` of the impulse are not looked at. False when it
  /// was refused. [audio-thread]: no heap, no lock, no throw.
  bool strike(const stream::Impulse& impulse) noexcept;

  /// The same for a force that is known step by step; played exactly.
  bool push(const stream::Force& force) noexcept;

  /// Contacts that last act from the next quantum on, or no more (nullptr). They must be of this voice's model and outlive their use. What
  /// is attached first hears of its first sample; release() before it is taken away, or a force is cut off. [audio-thread]
  void attach(ContactForces* contacts) noexcept { contacts_ = contacts; }

  /// Adds the pressure at 1 m [Pa] of the next pressure_pa.size() samples. A body without energy costs nothing.
  /// Denormal numbers are flushed to zero inside; the caller's setting is put back.
  /// [audio-thread]: no heap, no lock, no throw.
  void process(std::span<float> pressure_pa) noexcept;

  /// Plays at most this many modes, rounded up to whole groups of kGroup and at least one, the most audible; from the next multiple of
  /// kPeriod samples on. Those that it takes away fade out over kPeriod samples. [audio-thread]
  void set_limit(int modes) noexcept;

  /// How much there is to hear of each live group at this moment: a bound on the pressure [Pa] at the distance where 1 Pa at 1 m is
  /// `nearness` pascals, of this group or of a later one, whichever is larger, so that they never grow along the list. At a multiple of
  /// kPeriod samples only; good until the next call. [audio-thread]
  std::span<const float> measure(float nearness) noexcept;
  std::span<const float> get_measured() const noexcept { return std::span(bounds_).first(static_cast<std::size_t>(live_)); }

  /// Lets the live groups from `groups` on fade out over the period that begins; strikes may wake them again, contacts that last only after
  /// allow_driven(). At least one stays. At a multiple of kPeriod samples only. [audio-thread]
  void cut(int groups) noexcept { cut_ = driven_ = std::max(1, groups); }

  /// Lets contacts that last drive so many groups more than they may. [audio-thread]
  void allow_driven(int more) noexcept { driven_ = std::min(groups_, driven_ + more); }

  /// From now on a strike wakes only groups that it could lift to this pressure at 1 m [Pa], those before them in the list, and the first;
  /// 0, as at first: all. [audio-thread]
  void set_floor(float pressure_pa) noexcept { floor_pa_ = pressure_pa; }

  /// Goes on in place of another voice: at its time, with its strikes, each mode with the energy and the phase of its predecessor. The
  /// sound goes over within a period. At the start of a period of the other voice, which is of no more use afterwards; of a voice that is
  /// as it was made. A strike under way on a triangle that the model has not is refused. [audio-thread]
  void take_over(Voice& other, Succession& succession) noexcept;

  /// Samples processed so far: the number of the next sample.
  std::int64_t get_position() const { return horizon_ - held_; }
  /// The first sample that a new strike can still reach: less than kQuantum samples ahead of the position unless blocks are whole quanta.
  std::int64_t get_horizon() const { return horizon_; }
  const Model& get_model() const { return *model_; }
  /// Modes that are advanced at this moment, in whole groups.
  int get_live_mode_count() const;
  int get_live_group_count() const { return live_; }
  int get_group_count() const { return groups_; }
  bool is_awake() const { return live_ > 0 || damped_live_; }
  /// Nothing sounds, nothing is to come and nothing is left in the block: process() would only give zeros.
  bool is_idle() const {
    return !is_awake() && !fading_ && !inherits_ && pulses_.empty() && forces_.empty() && held_ == 0 &&
           (contacts_ == nullptr || contacts_->is_resting());
  }
  /// As process() for a multiple of kQuantum samples of a voice that is idle, without output. [audio-thread]
  void skip(std::int64_t samples) noexcept { horizon_ += samples; }
  /// Memory that this voice has taken, without that of the model.
  std::size_t calc_bytes() const;
  const VoiceCounters& get_counters() const { return counters_; }
  /// Sum over the sounded modes of (q'^2 + lambda q^2) / 2 [J] at the horizon, which must be a multiple of kPeriod.
  double calc_energy_j() const noexcept;

 private:
  /// A strike on its way.
  struct Pulse {
    double begin = 0.0, length = 0.0;  // of the time when its force is not zero, in samples
    stream::PulseShape shape = stream::PulseShape::kHertz;
    const std::int16_t* row[kStrikeRows];
    float weight[kStrikeRows];
    float strength_n_s = 0.0F;  // size of the impulse
    std::int32_t triangle = 0;
  };
  /// A force on its way. Its directions are those that its samples need: one where all are parallel.
  struct Steps {
    double begin = 0.0, step = 0.0;  // in samples
    std::int32_t triangle = 0;
    int count = 0, axes = 0;
    float strength_n_s = 0.0F;  // no more than this impulse reaches the body
    float barycentric[3];
    float axis[3][3];                         // unit
    float along[3][stream::kMostForceSteps];  // impulse of each step along each [N s]
    double calc_end() const { return begin + count * step; }
  };
  using StepMoments = std::array<Moments, 3>;  // along each axis

  void render(int quanta) noexcept;
  void begin_in_time(double& begin) noexcept;
  void find_touch(const Steps& steps, int axis) noexcept;
  static StepMoments calc_moments(const Steps& steps, double begin, double step);
  void push_steps(const Steps& steps, std::int64_t sample, int quantum, float* out) noexcept;
  bool is_struck(std::int64_t sample) const noexcept;
  void find_rows(std::int32_t triangle, const std::int16_t** row) const noexcept;
  DampedState get_mode_state(int mode) const noexcept;
  void ring_out(std::span<ModeState> states, std::span<DampedState> damped, float sign, std::array<float, kPeriod>& out) const noexcept;
  void wake(int groups) noexcept;
  int find_reach(float strength_n_s) const noexcept;
  void strike_quantum(std::int64_t sample, int quantum, float* out) noexcept;
  void add_damped(std::int64_t sample, bool struck, bool driven, float* out) noexcept;
  void follow_force(std::size_t mode, std::int64_t sample, int n) noexcept;
  double calc_amplitude(const std::int16_t* const* row, const float* weight, std::size_t mode) const noexcept;
  std::array<double, 3> calc_amplitudes(const Steps& steps, std::size_t mode) const noexcept;
  void begin_period() noexcept;
  void cull() noexcept;
  void fade_out(int groups) noexcept;
  void reset() noexcept;
  void audit() noexcept;
  double calc_ringing_energy_j(int mode) const noexcept;

  std::shared_ptr<const Model> model_;
  const Kernels* kernels_ = nullptr;
  double silence_pa_ = 0.0;
  int groups_ = 0;  // of the model
  int limit_ = 0;   // groups that may be played
  int live_ = 0;    // groups that are; those behind have no energy
  int cut_ = 0;     // groups that stay when the next period begins
  int driven_ = 0;  // groups that contacts may wake
  float floor_pa_ = 0.0F;
  bool damped_live_ = false;
  bool fading_ = false;       // fade_ holds what goes in this period: what the limit took away, what another model sounded
  bool inherits_ = false;     // fade_ is filled for the period that begins
  std::int64_t horizon_ = 0;  // samples rendered
  int held_ = 0;              // of them not yet handed out: the last of block_
  int rendered_ = 0;          // samples in block_
  bool silent_ = true;        // block_ is all zero
  bool audits_ = false, undisturbed_ = false;
  double energy_j_ = 0.0;  // at the start of the period, where it is audited
  struct Radiation {
    double part = 0.0;      // of the energy at the start of a period: what is radiated in it
    double energy_j = 0.0;  // at the start of the period
  };
  std::vector<Radiation> radiation_;  // of the ringing modes, where it is audited
  ContactForces* contacts_ = nullptr;
  VoiceCounters counters_;

  std::vector<ModeState> state_;  // zero beyond live_
  std::vector<Starts> starts_;    // out of date beyond live_, and once a whole period was rendered
  std::vector<DampedState> damped_;
  std::vector<double> damped_amplitude_;
  std::vector<float> bounds_;  // of measure()
  std::vector<Pulse> pulses_;  // capacity max_strikes, never grown
  std::vector<Steps> forces_;  // capacity max_forces, never grown
  Touch touch_;
  alignas(64) std::array<float, kPeriod> block_{}, fade_{};
};

}  // namespace carillon::synth

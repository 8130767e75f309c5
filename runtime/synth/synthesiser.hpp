// Real-time synthesis of a scene: bodies, microphones, and events in order of time.
//
//   synth::Synthesiser synthesiser({.rate_hz = 48000.0});
//   const int body = synthesiser.add_body(synth::Model::make(bank, {.rate_hz = 48000.0}), {.position_m = {0, 2, 0}});
//   synthesiser.push(events::Impulse{.time_s = 0.01, .body = body, .triangle = 12, .impulse_n_s = {0, 0, 0.01}, .duration_s = 1e-4});
//   synthesiser.process(channels, 2, 256);  // in the audio callback
//
// Effects are chosen per body when it is added. Disabled effects cost no memory and no time.
//
// Threads: the constructor, add_body, swap_model, remove_body and collect() belong to one main thread, process() to one audio thread;
// push() and the get_ members may be called by any thread at any time.
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/events/ring.hpp"
#include "runtime/synth/budget.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/listener.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/receiver.hpp"
#include "runtime/synth/sounding_body.hpp"
#include "runtime/synth/transfer_budget.hpp"

namespace carillon::synth {

struct SynthesiserOptions {
  double rate_hz = 48000.0;
  /// Offsets from the listener, in world axes without rotation (events::Listener::rotation); default: two ears 20 cm apart (OCE01).
  std::vector<Vec3> microphones_m{{-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}};
  Vec3 listener_m{};
  int max_bodies = 64;
  int max_strikes = 64;                                     // waiting or active pulses per body
  int max_forces = 128;                                     // waiting or active events::Forces per body
  int max_waypoints = 64;                                   // remembered waypoints per body
  int ring_events = 4096;                                   // capacity of the event ring between two calls of process()
  double longest_m = 60.0;                                  // maximum audible distance
  double budget = std::numeric_limits<double>::infinity();  // set_budget()
  /// Directivity: transfer look-ups of all bodies per second; at most a quarter more in one block. Default: 14 bodies with 228 modes and
  /// two ears, all looked up in every block at 48 kHz. If bodies need n times as many, each is looked up every n-th block on average
  /// (Directivity, TransferBudget).
  double transfers_per_s = 2.4e6;
  ContactSurface ground = kGroundSurface;     // for lasting contacts
  std::optional<Floor> floor = std::nullopt;  // for Effect::kGroundReflection
  /// For bodies with Effect::kHead and Effect::kTwoEars; in the middle of two microphones_m, left and right. Delays all sound
  /// (get_latency()), also of bodies without the effect.
  std::optional<ListeningHead> head = std::nullopt;
};

struct BodySettings {
  Vec3 position_m{};                                // of the centre of mass before the first BodyMotion
  events::Quaternion rotation{1.0, 0.0, 0.0, 0.0};  // of the mesh frame before the first BodyMotion
  EffectSet effects = kDefaultEffects;
  double silence_pa = 1e-10;  // ResonatorOptions
  ContactSurface surface{};   // in lasting contacts
  double gain = 1.0;          // factor of its pressure
  double longest_m = 0.0;     // 0: SynthesiserOptions::longest_m
  int max_waypoints = 0;      // 0: SynthesiserOptions::max_waypoints
  int max_forces = -1;        // -1: SynthesiserOptions::max_forces
  Isa isa = Isa::kBest;
  bool audits_energy = false;  // enables get_energy_rise() and get_mode_energy()
};

/// Work of the effects of one body since it was added. Units: modal: mode-samples; hertz_pulse: pulses; roughness, rolling: samples of
/// surface texture, per contact; contact_damping: samples with an active contact; acceleration_noise: samples of three dipoles; air_delay:
/// samples read with travel time; doppler: those with a changing travel time; two_ears: samples of all microphones but the first;
/// directivity: transfer look-ups; ground_reflection: samples of mirrored ears; head: filtered samples, straight and mirrored, for both
/// ears; nonlinear: coupled modes times samples; cascade: modes above the coupled ones times samples.
struct EffectCounters {
  PerEffect<std::int64_t> units{};
};

/// Totals since construction.
struct SynthesiserCounters {
  std::int64_t strikes = 0;       // played; several events::Forces of one pulse count once
  std::int64_t refused = 0;       // events for missing bodies, strikes outside the surface or beyond the capacity
  std::int64_t late = 0;          // strikes that began before the horizon and were moved to it
  std::int64_t faults = 0;        // unplayable events (events::find_fault)
  std::int64_t overflows = 0;     // events that did not fit into the ring
  std::int64_t resets = 0;        // bodies cleared because of a non-finite state
  std::int64_t mode_samples = 0;  // work: modes times samples
  std::int64_t faded = 0;         // groups of modes removed by the budget
  std::int64_t underruns = 0;     // times that the sound overtook the last events::TimeWatermark
  std::int64_t zeroed = 0;        // non-finite output samples, replaced by 0
  ContactRecordCounters contacts;
};

/// Invariant: a body number names at most one body; all bodies have rendered the same samples, in blocks of kBlock from the first sample;
/// events act in the order of push(); only process() touches playing bodies, only the main thread allocates and frees.
class Synthesiser {
 public:
  /// Allocates all memory that is not per body. Throws InputError for options out of range.
  explicit Synthesiser(SynthesiserOptions options);
  ~Synthesiser();
  Synthesiser(const Synthesiser&) = delete;
  Synthesiser& operator=(const Synthesiser&) = delete;

  /// Adds a body, heard from the next block on. Returns its number, which events name. Throws InputError when max_bodies exist, for a model
  /// of another rate, and for effects that the model or the scene cannot have. [main-thread]
  int add_body(std::shared_ptr<const Model> model, const BodySettings& settings = {});

  /// Replaces the model of a body by another of the same shape: an edit of its bank (bank::calc_edited) or the same bank with other gains.
  /// Modes correspond by their number in the bank: each keeps its energy and phase and continues at its new frequency and decay, with a
  /// cross-fade over one block; other modes fade out or begin at rest. Active strikes act on the new model. The memory of the old model is
  /// freed by collect() once the audio thread has released it. While a swap is in progress later ones wait, and of those only the last is
  /// played. Throws InputError for a missing body, one with sensors, a model of another rate, and one that cannot have the body's effects.
  /// [main-thread]
  void swap_model(int body, std::shared_ptr<const Model> model);

  /// Adds a sensor to a body, which reads from the next block on. `bank`: that of the body's model, not kept. Returns its number. Bodies
  /// without sensors do no work for them. Throws InputError for a missing body, one without Effect::kModal, the acceleration of one with
  /// Effect::kNonlinear, whose coupling forces it would lack, more than BodySensors::kMax of a body or kMaxSensors, and as Sensor does.
  /// [main-thread]
  int add_sensor(int body, const bank::Bank& bank, const SensorSettings& settings);
  /// nullptr for a missing number. A sensor outlives its body until the next add_sensor(), which may take its number. [any-thread]
  Sensor* find_sensor(int sensor) const noexcept {
    return sensor >= 0 && sensor < sensor_count_.load(std::memory_order_acquire) ? sensors_[sensor].get() : nullptr;
  }
  static constexpr int kMaxSensors = 4096;

  /// Throws InputError for a missing body. [main-thread]
  EffectSet get_effects(int body) const;

  /// The body falls silent at the next block. Its number may be given to a new body after collect(). [main-thread]
  void remove_body(int body);

  /// True when max_bodies exist. [main-thread]
  bool is_full() noexcept;

  /// Frees removed bodies and replaced models after their release by the audio thread, and sends pending swaps. A swap that cannot allocate
  /// stays pending. [main-thread]
  void collect() noexcept;

  /// Full scale per pascal; 1 at first. Infinity and NaN count as 0. [any-thread]
  void set_gain(double per_pa) noexcept {
    gain_.store(std::isfinite(per_pa) ? static_cast<float>(per_pa) : 0.0F, std::memory_order_relaxed);
  }

  /// Maximum mode-samples per second of sound (modes times samples); infinity: no limit. Beyond it the modes that are least audible at the
  /// microphones, over all bodies, fade out over a block, except for the first kGroup of each body; the next strike brings them back. NaN
  /// counts as 0. A pure function of the events: no clock. [any-thread]
  void set_budget(double mode_samples_per_s) noexcept { allowed_.store(mode_samples_per_s, std::memory_order_relaxed); }
  double get_budget() const noexcept { return allowed_.load(std::memory_order_relaxed); }

  /// Times of events are seconds since the first sample. False when the event is refused (counted). [any-thread]: no heap, no lock, no
  /// throw.
  bool push(const events::Event& event) noexcept { return ring_.push(event); }

  /// Renders the next frames, one channel per microphone; further channels are silent. out[c]: (frames). Frame n is the sound at time
  /// (n - get_latency()) / rate. The bits do not depend on the block sizes as long as events come before the horizon. frames = 0: only
  /// empties the event ring. [audio-thread]: no heap, no lock, no system call, no throw.
  void process(float* const* out, int channels, int frames) noexcept;

  static constexpr int kLatency = Receiver::kLatency;  // without a head
  /// Delay of the sound [frames]. [any-thread]
  int get_latency() const noexcept { return latency_; }
  /// Capacity of the event ring. [any-thread]
  std::size_t get_ring_room() const noexcept { return ring_.get_room(); }
  int get_microphone_count() const { return static_cast<int>(options_.microphones_m.size()); }
  /// Time of the next frame. [any-thread]
  double get_time_s() const noexcept { return static_cast<double>(position_.load(std::memory_order_relaxed)) / options_.rate_hz; }
  /// Events from this time on are not late: at most kBlock frames after get_time_s(). [any-thread]
  double get_horizon_s() const noexcept { return static_cast<double>(horizon_.load(std::memory_order_relaxed)) / options_.rate_hz; }
  SynthesiserCounters get_counters() const noexcept;
  /// Zeros for a missing body. [any-thread]
  EffectCounters get_effect_counters(int body) const noexcept;
  /// Largest modal pressure so far [Pa at 1 m]. [any-thread]
  double get_peak_pa(int body) const noexcept;
  /// Largest modal deflection so far, in thicknesses (find_judged_thickness_m()). 0 up to kLinearThicknesses, the linear range, and without
  /// a judged thickness. [any-thread]
  double get_deflection(int body) const noexcept;
  /// Current amplitude of each modal coordinate q [m kg^1/2], by number in the bank; 0 for modes at rest or not in the model. False for a
  /// missing body. [audio-thread], between calls of process().
  bool measure_amplitudes(int body, std::span<float> by_bank_mode) const noexcept;
  /// With audits_energy: largest relative rise of the modal energy over a block without forces. [any-thread]
  double get_energy_rise(int body) const noexcept;
  /// With audits_energy: energy balance of the modes. [any-thread]; during process() the four numbers may belong to different times.
  ModeEnergy get_mode_energy(int body) const noexcept;

 private:
  /// Request to the audio thread, and its answer: a removed body, or a finished swap.
  struct Command {
    enum class Kind : std::uint8_t { kAdd, kSwap, kRemove, kSense };
    SoundingBody* body = nullptr;
    ModelSwap* swap = nullptr;
    BodySensors* sensors = nullptr;
    Sensor* sensor = nullptr;
    int number = -1;
    Kind kind = Kind::kAdd;
  };
  /// Main thread's view of a body.
  struct Owned {
    std::unique_ptr<SoundingBody> body;
    std::unique_ptr<ModelSwap> swap;            // in progress
    std::shared_ptr<const Model> wanted_model;  // pending; nullptr: none
    std::unique_ptr<BodySensors> sensors;       // nullptr: none
    std::vector<int> sensor_numbers;
    bool is_leaving = false;
  };
  /// Figures of a body for all threads.
  struct Published {
    PerEffect<std::atomic<std::int64_t>> units{};
    std::atomic<float> peak_pa{0.0F};
    std::atomic<double> deflection{0.0}, energy_rise{0.0}, given_j{0.0}, lost_j{0.0}, held_j{0.0}, radiated_j{0.0};
  };
  template <typename T>
  class Pipe;

  void check_model(const Model* model) const;
  void check_surroundings(EffectSet effects) const;
  std::size_t check_owned(int body) const;
  std::size_t find_free() const;
  void send_swap(int number);
  void apply_commands() noexcept;
  void finish_swaps() noexcept;
  void take_events() noexcept;
  void take(const events::TimeWatermark& mark) noexcept;
  void watch_marks() noexcept;
  template <class Strike>
  void take_strike(const Strike& strike) noexcept;
  void take(const events::LastingContact& contact) noexcept;
  void take(const events::BodyMotion& motion) noexcept;
  void take(const events::Listener& listener) noexcept;
  void render(int samples) noexcept;
  SoundingBody* find_body(std::int32_t number) noexcept;
  void set_awake(int number) noexcept;
  template <typename Work>
  void count(const SoundingBody& body, Work&& work) noexcept;
  template <typename Work>
  void for_awake(Work&& work) noexcept;
  void publish(int number) noexcept;
  void keep_budget() noexcept;
  void list_kinds() noexcept;
  void share_transfers() noexcept;
  void give_floor(SoundingBody& body) noexcept;
  void publish_counters() noexcept;

  SynthesiserOptions options_;
  int latency_ = kLatency;
  events::EventRing ring_;
  std::unique_ptr<Pipe<Command>> commands_;
  std::unique_ptr<Pipe<Command>> gone_;
  std::vector<Owned> owned_;  // by number; main thread
  bool has_unsent_ = false;   // a pending swap could not allocate
  std::unique_ptr<Published[]> published_bodies_;
  std::vector<SoundingBody*> playing_;  // by number; audio thread
  std::vector<std::uint64_t> awake_;    // bit i % 64 of word i / 64: body i is awake
  ListenerTracks listener_;
  Mix mix_;
  BodyScratch scratch_;
  double marked_s_ = 0.0;  // last TimeWatermark
  bool has_marks_ = false, is_overtaken_ = false;
  int rendered_ = 0;         // samples in mix_
  int held_ = 0;             // last samples of mix_, not yet output
  std::int64_t sample_ = 0;  // rendered so far
  Budget budget_;
  bool limited_ = false;           // a budget is set
  std::int64_t spent_before_ = 0;  // mode-samples before the last block
  TransferBudget transfers_;
  std::vector<SoundingBody*> directed_;  // bodies with directivity, by number
  std::vector<SoundingBody*> sensed_;    // bodies with sensors, by number
  std::vector<std::unique_ptr<Sensor>> sensors_;
  std::vector<int> free_sensors_;  // numbers whose body is gone
  std::atomic<int> sensor_count_{0};
  std::atomic<double> allowed_;
  SynthesiserCounters work_;  // audio thread
  std::atomic<float> gain_{1.0F};
  std::atomic<std::int64_t> position_{0};
  std::atomic<std::int64_t> horizon_{0};
  std::array<std::atomic<std::int64_t>, 13> published_{};
};

}  // namespace carillon::synth

// A scene that sounds: bodies that ring, heard by microphones, played block by block as events come in.
//
//   synth::Synthesiser synthesiser({.rate_hz = 48000.0});
//   const int body = synthesiser.add_body(synth::Model::make(bank, {.rate_hz = 48000.0}), {.position_m = {0, 2, 0}});
//   synthesiser.push(events::Impulse{.time_s = 0.01, .body = body, .triangle = 12, .impulse_n_s = {0, 0, 0.01}, .duration_s = 1e-4});
//   synthesiser.process(channels, 2, 256);  // in the audio callback
//
// The costs of a body are those of its effects: an effect that is off takes no memory and executes nothing.
//
// Threads: the constructor, add_body, remove_body, set_effects and collect() belong to one main thread, process() to one audio thread;
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
  /// From the listener, in the axes of the world as long as it is not turned (events::Listener::rotation); by default two ears 20 cm apart
  /// (OCE01).
  std::vector<Vec3> microphones_m{{-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}};
  Vec3 listener_m{};
  int max_bodies = 64;
  int max_strikes = 64;                                     // pulses that a body may have waiting or acting at once
  int max_forces = 128;                                     // events::Forces that it may
  int max_waypoints = 64;                                   // of a body's way that are remembered
  int ring_events = 4096;                                   // that may wait between two calls of process()
  double longest_m = 60.0;                                  // sound from further away is inaudible
  double budget = std::numeric_limits<double>::infinity();  // set_budget()
  /// Of Effect::kDirectivity: transfers that all bodies together look up in a second; in a block a quarter more at most. By default those
  /// of 14 bodies with 228 modes and two ears that are all looked up in every block, at 48 kHz. Where bodies need n times as many, each is
  /// looked up every n-th block on average: its modes are that old, or go so long from one weight to the next (Directivity,
  /// TransferBudget).
  double transfers_per_s = 2.4e6;
  ContactSurface ground = kGroundSurface;     // surface of the ground in contacts
  std::optional<Floor> floor = std::nullopt;  // for Effect::kGroundReflection
  /// For bodies with Effect::kHead and Effect::kTwoEars, in the middle of two microphones_m, left and right. It delays all sound
  /// (get_latency()), also of bodies without the effect.
  std::optional<ListeningHead> head = std::nullopt;
  /// A counter of time for the costs of effects; nullptr: no measurement, at no cost.
  TickFunction ticks = nullptr;
};

struct BodySettings {
  Vec3 position_m{};                                // of the centre of mass until the first Motion
  events::Quaternion rotation{1.0, 0.0, 0.0, 0.0};  // of the frame of its mesh until then
  EffectSet effects = kDefaultEffects;
  double silence_pa = 1e-10;  // VoiceOptions
  ContactSurface surface{};   // in lasting contacts
  double longest_m = 0.0;     // 0: that of SynthesiserOptions
  int max_waypoints = 0;      // likewise
  int max_forces = -1;        // -1: that of SynthesiserOptions
  Isa isa = Isa::kBest;
  bool audits_energy = false;  // get_energy_rise(), get_mode_energy()
};

/// Work of the effects of one body since it was added, and their memory. An effect that is off keeps its units and holds nothing.
struct EffectCounters {
  /// Work: of modal mode-samples, of hertz_pulse pulses, of roughness and rolling samples of the texture that both read, contact by
  /// contact, of contact_damping samples in which a contact is at work, of acceleration_noise samples (of three dipoles), of air_delay
  /// samples that an ear read with travel time, of doppler those whose travel time changed, of two_ears those of the second microphone and
  /// all further, of directivity transfers that were looked up, of ground_reflection samples that mirrored ears read, of head samples that
  /// went through one, straight and mirrored, for both ears, of nonlinear coupled modes times samples.
  PerEffect<std::int64_t> units{};
  /// Of SynthesiserOptions::ticks. modal has pulses, coupled modes and the products of modes with transfers. The cost of modes during a
  /// contact is in the first of roughness, rolling and contact_damping that the body has, as are their bytes. An ear's time is in
  /// two_ears from the second microphone on; that of the first in doppler where the way changes, else in air_delay, else in the source.
  /// That of mirrored ears is in ground_reflection. A head's filters are in head, and its middle is one ear.
  PerEffect<std::int64_t> ticks{};
  EffectBytes bytes{};  // without the model, which bodies share, and without the memory of a body without effects
};

/// Since the beginning.
struct SynthesiserCounters {
  std::int64_t strikes = 0;       // played; a pulse of several events::Forces is one
  std::int64_t refused = 0;       // events for a body that is not there, strikes outside its surface or for which it has no room
  std::int64_t late = 0;          // strikes that began before the horizon and were moved there
  std::int64_t faults = 0;        // events that cannot be played (events::find_fault)
  std::int64_t overflows = 0;     // events for which the ring had no room
  std::int64_t resets = 0;        // bodies silenced because their state was no number
  std::int64_t mode_samples = 0;  // work: modes times samples
  std::int64_t faded = 0;         // groups of modes that had to go for the budget
  std::int64_t underruns = 0;     // times that the sound overtook the last events::TimeWatermark
  std::int64_t zeroed = 0;        // numbers of the output that were none, and are 0
  ContactRecordCounters contacts;
};

/// Invariant: body numbers name at most one body that sounds; all bodies have rendered the same samples, in blocks of kBlock from
/// the first sample; an event acts in the order in which it was pushed; only process() touches what sounds, only the main thread takes and
/// gives back memory.
class Synthesiser {
 public:
  /// Takes all memory that does not belong to a body. Throws InputError for options out of range.
  explicit Synthesiser(SynthesiserOptions options);
  ~Synthesiser();
  Synthesiser(const Synthesiser&) = delete;
  Synthesiser& operator=(const Synthesiser&) = delete;

  /// A new body, heard from the next block on; its number, which events name. Takes its memory here. Throws InputError when max_bodies are
  /// there, or when the model is for another rate. [main-thread]
  int add_body(std::shared_ptr<const Model> model, const BodySettings& settings = {});

  /// Gives a body another set of effects: makes what it lacks here, and lets the audio thread put it in and take out what is not needed any
  /// more, at a block and without a click: the sound changes over within a block, as soon as the new way of the air is filled. One
  /// change of a body is on its way at a time: a later one waits, and begins with the first collect() (or call of this) after the earlier
  /// one is over. Throws InputError when there is no such body, or for an effect that this build or the body's model cannot have.
  /// [main-thread]
  void set_effects(int body, EffectSet effects);

  /// The body continues to ring as another, of the same shape: an edit of its bank (bank::calc_edited) or the same bank with other gains.
  /// Modes of the same number in the bank are the same: each keeps its energy and its phase and continues at its new frequency and decay,
  /// the sound going over within a block; modes that only one of the two has begin at rest or fade. Strikes under way act on the new model.
  /// Takes memory here; that of the old model and its voice is given back by collect() once the audio thread has let go. One that comes
  /// before the last has been taken waits for it, and of those that wait only the last is played. Throws InputError for a body that is not
  /// there, for a model of another rate, and for one that cannot have the body's effects. [main-thread]
  void swap_model(int body, std::shared_ptr<const Model> model);

  /// The effects of the last call. Throws InputError when there is no such body. [main-thread]
  EffectSet get_effects(int body) const;

  /// The body falls silent at the next block. Its number may be given to a new body after collect(). [main-thread]
  void remove_body(int body);

  /// True without room for another body. [main-thread]
  bool is_full() noexcept;

  /// Frees the memory of removed bodies and effects after their release by the audio thread, and sends pending changes. A change without
  /// enough memory stays pending. [main-thread]
  void collect() noexcept;

  /// Full scale per pascal; 1 at first. Infinity and NaN count as 0. [any-thread]
  void set_gain(double per_pa) noexcept {
    gain_.store(std::isfinite(per_pa) ? static_cast<float>(per_pa) : 0.0F, std::memory_order_relaxed);
  }

  /// Mode-samples that a second of sound may take (modes times samples, as the counters count them); infinity: as many as there are. When
  /// there are more, the modes that are least audible at the microphones fade out over a block, over all bodies, though never the first
  /// kGroup of one that rings; they come back with the next strike. Not a number counts as 0. A pure function of the events: no clock.
  /// [any-thread]
  void set_budget(double mode_samples_per_s) noexcept { allowed_.store(mode_samples_per_s, std::memory_order_relaxed); }
  double get_budget() const noexcept { return allowed_.load(std::memory_order_relaxed); }

  /// Times of events are seconds since the first sample. False when the event is refused (counted). [any-thread]: no heap, no lock, no
  /// throw.
  bool push(const events::Event& event) noexcept { return ring_.push(event); }

  /// The next frames of up to as many channels as there are microphones; further channels are silent. out[c] has room for `frames` numbers.
  /// Frame n arrives at (n - get_latency()) / rate. Any number of frames, in any order, gives the same bits, as long as events come
  /// before the horizon. No frames: takes the events out of the ring, so that there is room for more. [audio-thread]: no heap, no lock, no
  /// system call, no throw.
  void process(float* const* out, int channels, int frames) noexcept;

  static constexpr int kLatency = Receiver::kLatency;  // without a head
  /// Delay of the sound [frames]. [any-thread]
  int get_latency() const noexcept { return latency_; }
  /// Events that fit into the ring between two calls of process(). [any-thread]
  std::size_t get_ring_room() const noexcept { return ring_.get_room(); }
  int get_microphone_count() const { return static_cast<int>(options_.microphones_m.size()); }
  /// Of the next frame. [any-thread]
  double get_time_s() const noexcept { return static_cast<double>(position_.load(std::memory_order_relaxed)) / options_.rate_hz; }
  /// An event at or after this is in time: at most kBlock frames after get_time_s(). [any-thread]
  double get_horizon_s() const noexcept { return static_cast<double>(horizon_.load(std::memory_order_relaxed)) / options_.rate_hz; }
  SynthesiserCounters get_counters() const noexcept;
  /// Zeros for a number that is no body's. [any-thread]
  EffectCounters get_effect_counters(int body) const noexcept;
  /// The loudest that its modes have been so far [Pa at 1 m]. [any-thread]
  double get_peak_pa(int body) const noexcept;
  /// Largest deflection by its modes so far, in thicknesses (find_judged_thickness_m()). 0 up to kLinearThicknesses, the range of linear
  /// modes, and without a judged thickness. [any-thread]
  double get_deflection(int body) const noexcept;
  /// The present amplitude of each mode's coordinate q [m kg^1/2], by number in the bank; 0 for modes that do not ring or are not in the
  /// model. False for a number that is no body's. [audio-thread], between calls of process().
  bool measure_amplitudes(int body, std::span<float> by_bank_mode) const noexcept;
  /// Of a body that audits_energy: the largest share by which the energy of its modes rose over a block in which nothing acted on it.
  /// [any-thread]
  double get_energy_rise(int body) const noexcept;
  /// Energy given to, held by, lost and radiated by the modes of a body with audits_energy. [any-thread]; during process() the four may be
  /// of different moments.
  ModeEnergy get_mode_energy(int body) const noexcept;

 private:
  /// A request to the audio thread, and its answer: a removed body, or a finished change.
  struct Command {
    SoundingBody* body = nullptr;
    BodyChange* change = nullptr;
    int number = -1;
    bool removes = false;
  };
  /// A body as the main thread sees it.
  struct Owned {
    std::unique_ptr<SoundingBody> body;
    std::unique_ptr<BodyChange> change;         // on its way
    std::shared_ptr<const Model> wanted_model;  // that waits; nullptr: none
    EffectSet effects, wanted;                  // with that change; after those that wait
    EffectBytes bytes;
    bool is_leaving = false;
  };
  /// Figures of a body for all threads.
  struct Published {
    PerEffect<std::atomic<std::int64_t>> units{}, ticks{}, bytes{};
    std::atomic<float> peak_pa{0.0F};
    std::atomic<double> deflection{0.0}, energy_rise{0.0}, given_j{0.0}, lost_j{0.0}, held_j{0.0}, radiated_j{0.0};
  };
  template <typename T>
  class Pipe;

  void check_model(const Model* model) const;
  void check_surroundings(EffectSet effects) const;
  std::size_t check_owned(int body) const;
  std::size_t find_free() const;
  void send_change(int number);
  void publish_bytes(int number);
  void apply_commands() noexcept;
  void finish_changes() noexcept;
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
  void list_directed() noexcept;
  void share_transfers() noexcept;
  void give_floor(SoundingBody& body) noexcept;
  void publish_counters() noexcept;

  SynthesiserOptions options_;
  int latency_ = kLatency;
  events::EventRing ring_;
  std::unique_ptr<Pipe<Command>> commands_;
  std::unique_ptr<Pipe<Command>> gone_;
  std::vector<Owned> owned_;  // by number; the main thread's
  bool has_unsent_ = false;   // a change of one of them, for lack of memory
  std::unique_ptr<Published[]> published_bodies_;
  std::vector<SoundingBody*> playing_;  // by number; the audio thread's
  std::vector<std::uint64_t> awake_;    // bit i % 64 of word i / 64: body i has something to do
  ListenerTracks listener_;
  Mix mix_;
  BodyScratch scratch_;
  double marked_s_ = 0.0;  // of the last TimeWatermark: nothing earlier will come
  bool has_marks_ = false, is_overtaken_ = false;
  int rendered_ = 0;         // samples in mix_
  int held_ = 0;             // of them not yet handed out: the last
  std::int64_t sample_ = 0;  // rendered so far
  Budget budget_;
  bool limited_ = false;           // voices have floors
  std::int64_t spent_before_ = 0;  // mode-samples up to the last block
  TransferBudget transfers_;
  std::vector<SoundingBody*> directed_;  // bodies with directivity, in the order of their numbers
  std::atomic<double> allowed_;
  SynthesiserCounters work_;  // the audio thread's
  std::atomic<float> gain_{1.0F};
  std::atomic<std::int64_t> position_{0};
  std::atomic<std::int64_t> horizon_{0};
  std::array<std::atomic<std::int64_t>, 13> published_{};
};

}  // namespace carillon::synth

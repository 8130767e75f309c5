// A scene that sounds: bodies that ring, heard by microphones, played block by block as events come in.
//
//   synth::Synthesiser synthesiser({.rate_hz = 48000.0});
//   const int body = synthesiser.add_body(synth::Model::make(bank, {.rate_hz = 48000.0}), {.position_m = {0, 2, 0}});
//   synthesiser.push(stream::Impulse{.time_s = 0.01, .body = body, .triangle = 12, .impulse_n_s = {0, 0, 0.01}, .duration_s = 1e-4});
//   synthesiser.process(channels, 2, 256);  // in the audio callback
//
// Threads: the constructor, add_body, remove_body and collect() belong to one main thread, process() to one audio thread;
// push() and the get_ members may be called by any thread at any time.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/stream/events.hpp"
#include "runtime/stream/ring.hpp"
#include "runtime/synth/ears.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/voice.hpp"

namespace carillon::synth {

struct SynthesiserOptions {
  double rate_hz = 48000.0;
  /// From the listener, in the axes of the world: by default two ears 20 cm apart (OCE01).
  std::vector<Vec3> microphones_m{{-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}};
  Vec3 listener_m{};
  int max_bodies = 64;
  int max_strikes = 64;     // that a body may have waiting or acting at once
  int max_waypoints = 64;   // of a body's way that are remembered
  int ring_events = 4096;   // that may wait between two calls of process()
  double longest_m = 60.0;  // what is further away is not heard
};

struct BodySettings {
  Vec3 position_m{};          // of the centre of mass until the first Motion
  double silence_pa = 1e-10;  // VoiceOptions
  Isa isa = Isa::kBest;
};

/// Since the beginning.
struct SynthesiserCounters {
  std::int64_t strikes = 0;       // played
  std::int64_t refused = 0;       // events for a body that is not there, strikes outside its surface or for which it has no room
  std::int64_t late = 0;          // strikes that began before the horizon and were moved there
  std::int64_t faults = 0;        // events that cannot be played (stream::find_fault)
  std::int64_t overflows = 0;     // events for which the ring had no room
  std::int64_t resets = 0;        // bodies silenced because their state was no number
  std::int64_t mode_samples = 0;  // work: modes times samples
};

class Synthesiser {
 public:
  /// Takes all memory that does not belong to a body. Throws InputError for options out of range.
  explicit Synthesiser(SynthesiserOptions options);
  ~Synthesiser();
  Synthesiser(const Synthesiser&) = delete;
  Synthesiser& operator=(const Synthesiser&) = delete;

  /// A new body, heard from the next period on; its number, which events name. Takes its memory here. Throws InputError when max_bodies are
  /// there, or when the model is for another rate. [main-thread]
  int add_body(std::shared_ptr<const Model> model, const BodySettings& settings = {});

  /// The body falls silent at the next period. Its number may be given to a new body after collect(). [main-thread]
  void remove_body(int body);

  /// Whether add_body() would find no room. [main-thread]
  bool is_full();

  /// Gives back the memory of removed bodies that the audio thread has let go. [main-thread]
  void collect();

  /// Full scale per pascal; 1 at first. [any-thread]
  void set_gain(double per_pa) noexcept { gain_.store(static_cast<float>(per_pa), std::memory_order_relaxed); }

  /// Times of events are seconds since the first sample. False when the event is refused (counted). [any-thread]: no heap, no lock, no
  /// throw.
  bool push(const stream::Event& event) noexcept { return ring_.push(event); }

  /// The next frames of up to as many channels as there are microphones; further channels are silent. out[c] has room for `frames` numbers.
  /// Frame n is what arrives at (n - kLatency) / rate. Any number of frames, in any order, gives the same bits, as long as events come
  /// before the horizon. [audio-thread]: no heap, no lock, no system call, no throw.
  void process(float* const* out, int channels, int frames) noexcept;

  static constexpr int kLatency = Ear::kLatency;
  int get_microphone_count() const { return static_cast<int>(options_.microphones_m.size()); }
  /// Of the next frame. [any-thread]
  double get_time_s() const noexcept { return static_cast<double>(position_.load(std::memory_order_relaxed)) / options_.rate_hz; }
  /// An event at or after this is in time: at most kPeriod frames after get_time_s(). [any-thread]
  double get_horizon_s() const noexcept { return static_cast<double>(horizon_.load(std::memory_order_relaxed)) / options_.rate_hz; }
  SynthesiserCounters get_counters() const noexcept;

 private:
  struct Body;
  /// What the main thread asks of the audio thread, and what comes back.
  struct Command {
    Body* body = nullptr;
    int number = -1;
    bool removes = false;
  };
  template <typename T>
  class Pipe;

  void apply_commands() noexcept;
  void take_events() noexcept;
  void take(const stream::Impulse& impulse) noexcept;
  void take(const stream::Motion& motion) noexcept;
  void take(const stream::Listener& listener) noexcept;
  void render(int samples) noexcept;
  Body* find_body(std::int32_t number) noexcept;
  void publish_counters() noexcept;

  SynthesiserOptions options_;
  stream::EventRing ring_;
  std::unique_ptr<Pipe<Command>> commands_;
  std::unique_ptr<Pipe<Command>> gone_;
  std::vector<std::unique_ptr<Body>> owned_;  // by number; the main thread's
  std::vector<bool> leaving_;                 // the main thread's
  std::vector<Body*> playing_;                // by number; the audio thread's
  Track listener_;
  std::vector<std::array<double, kPeriod>> mix_;  // per microphone
  std::array<float, kPeriod> mono_{};
  int rendered_ = 0;          // samples in mix_
  int held_ = 0;              // of them not yet handed out: the last
  std::int64_t sample_ = 0;   // rendered so far
  SynthesiserCounters work_;  // the audio thread's
  std::atomic<float> gain_{1.0F};
  std::atomic<std::int64_t> position_{0};
  std::atomic<std::int64_t> horizon_{0};
  std::array<std::atomic<std::int64_t>, 5> published_{};
};

}  // namespace carillon::synth

// One body of a Synthesiser: the modules that its effects need, and the change from one set of effects to another while it plays.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/stream/events.hpp"
#include "runtime/synth/click.hpp"
#include "runtime/synth/contact_forces.hpp"
#include "runtime/synth/ears.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/history.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/track.hpp"
#include "runtime/synth/voice.hpp"

namespace carillon::synth {

/// What a body is made for, besides its model.
struct BodyFrame {
  double rate_hz = 0.0;
  std::vector<Vec3> microphones_m;  // from the listener
  int max_strikes = 0, max_forces = 0;
  int max_waypoints = 0;
  double longest_m = 0.0;
  double silence_pa = 1e-10;
  Isa isa = Isa::kBest;
  Surface surface{};
  bool audits_energy = false;
};

/// Memory that belongs to effects. What lasting contacts need counts as that of roughness here, whichever of the three effects need it.
using EffectBytes = PerEffect<std::int64_t>;

/// The click of a body with its attitude.
struct Clicker {
  Click click;
  Attitude attitude;
  std::int64_t first = 0;  // sample of the scene with which the click began
};

/// The way from what a body sends to what is heard of it.
struct Air {
  EffectSet effects;
  std::unique_ptr<History> monopole;               // with modes
  std::array<std::unique_ptr<History>, 3> dipole;  // with acceleration noise
  std::vector<Ear> ears;                           // one a microphone, or one for all without two ears
  std::int64_t first = 0;                          // sample of the scene with which it began
  Source source;

  bool is_silent() const noexcept;
};

/// Modules on their way into a body, and what they took the place of on its way out. Made and destroyed on the main thread.
struct BodyChange {
  EffectSet effects;
  std::unique_ptr<Voice> voice;
  std::unique_ptr<Clicker> clicker;
  std::unique_ptr<Air> air;
  std::unique_ptr<ContactForces> contacts;
  double modulus_pa = 0.0;                 // of the surface
  bool inherits = false;                   // voice, contacts and clicker go on in place of those there
  std::unique_ptr<Succession> succession;  // for the voice

  EffectBytes calc_bytes() const;
};

/// What a body has done: work by effect, in the units of EffectCounters, and ticks if they are measured.
struct BodyWork {
  PerEffect<std::int64_t> units{};
  PerEffect<std::int64_t> ticks{};
  std::int64_t strikes = 0, refused = 0, late = 0, resets = 0;
  float peak_pa = 0.0F;
  double energy_rise = 0.0, radiated_j = 0.0;  // VoiceCounters
};

using TickFunction = std::uint64_t (*)() noexcept;

/// Room for one period of a body's sound, shared by all bodies.
struct BodyScratch {
  std::array<float, kPeriod> mono{};
  std::array<std::array<float, kPeriod>, 3> dipole{};
  std::array<double, kPeriod> heard{};
};

using Mix = std::vector<std::array<double, kPeriod>>;  // per microphone

class Body {
 public:
  /// Without any effects: apply() brings them. Takes memory for its way. [main-thread]
  Body(std::shared_ptr<const Model> model, BodyFrame frame, const Vec3& position_m, const stream::Quaternion& rotation);

  /// The modules that a body of effects `from` lacks for `to`, and with another model those that take the place of all that know the old
  /// one; `model` is what the body has from then on. Throws as check() does. [main-thread]
  std::unique_ptr<BodyChange> make_change(EffectSet from, EffectSet to, std::shared_ptr<const Model> model);
  std::unique_ptr<BodyChange> make_change(EffectSet from, EffectSet to) { return make_change(from, to, model_); }
  /// Throws InputError for effects that this build or a body of this model cannot have. [main-thread]
  static void check(EffectSet effects, const Model& model);
  void check(EffectSet effects) const { check(effects, *model_); }

  /// All that follows: [audio-thread], no heap, no lock, no throw.

  /// The change begins with this sample, the first of a period; it is over when finish_change() says so.
  void apply(BodyChange& change, const Track& listener, std::int64_t sample) noexcept;
  /// At the first sample of a period: the change that is over now, with the modules that are not needed any more; or nullptr.
  BodyChange* finish_change(const Track& listener, std::int64_t sample) noexcept;

  /// `sample`: the first that is not rendered. False when no effect could take it.
  bool take(const stream::Impulse& impulse, std::int64_t sample) noexcept;
  bool take(const stream::Force& force, std::int64_t sample) noexcept;
  /// `other`: the surface of the other body.
  bool take(const stream::Contact& contact, const Surface& other, std::int64_t sample) noexcept;
  bool take(const stream::Motion& motion) noexcept;

  /// Adds to `mix` what is heard of it in samples `sample` to `sample + count`, all of one period.
  void render(std::int64_t sample, std::size_t count, const Track& listener, BodyScratch& scratch, Mix& mix, TickFunction ticks) noexcept;

  /// Nothing sounds, nothing is under way, nothing is to come: until the next event render() would add nothing.
  bool is_asleep() const noexcept;
  /// Nothing earlier will come. For bodies that are awake, before render().
  void reach(double time_s) noexcept;
  const Surface& get_surface() const noexcept { return surface_; }  // as others feel it
  const BodyWork& get_work() const { return work_; }
  /// Its modes; nullptr without.
  Voice* get_voice() noexcept { return voice_.get(); }
  /// How many pascals 1 Pa at 1 m is at the nearest microphone, at a sample.
  float calc_nearness(const Track& listener, std::int64_t sample) const noexcept;

 private:
  template <class Strike>
  bool play(const Strike& strike, bool has_length, bool is_new, std::int64_t sample) noexcept;
  void wake(std::int64_t sample) noexcept;
  void put_contacts(BodyChange& change) noexcept;
  void make_sound(std::size_t count, BodyScratch& scratch, TickFunction ticks) noexcept;
  void hear(Air& air, std::int64_t sample, std::size_t count, const Track& listener, int fade, BodyScratch& scratch, Mix& mix,
            TickFunction ticks) noexcept;
  bool is_filled(const Air& air, const Track& listener, std::int64_t sample) const noexcept;

  std::shared_ptr<const Model> model_;  // the main thread's
  BodyFrame frame_;
  Track track_;
  double turned_s_ = 0.0;  // of rotation_
  stream::Quaternion rotation_{1.0, 0.0, 0.0, 0.0};
  EffectSet effects_;
  std::unique_ptr<Voice> voice_;
  std::unique_ptr<Clicker> clicker_;
  std::unique_ptr<ContactForces> contacts_;  // attached to voice_
  Surface surface_;                          // with the modulus of the model
  std::unique_ptr<Air> air_, next_air_;
  BodyChange* change_ = nullptr;
  bool fading_ = false;        // from air_ to next_air_, in this period
  std::int64_t first_ = 0;     // sample of the scene with which the voice began
  std::int64_t rendered_ = 0;  // samples of the scene that all modules have done
  BodyWork work_;
};

}  // namespace carillon::synth

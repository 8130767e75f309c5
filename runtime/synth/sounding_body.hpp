// One body of a Synthesiser: the modules that its effects need, and the change from one set of effects to another while it plays.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/synth/acceleration_noise.hpp"
#include "runtime/synth/contact_forces.hpp"
#include "runtime/synth/delay_line.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/listener.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/propagation.hpp"
#include "runtime/synth/receiver.hpp"
#include "runtime/synth/trajectory.hpp"
#include "runtime/synth/transfer_budget.hpp"
#include "runtime/synth/voice.hpp"

namespace carillon::synth {

/// The surroundings and limits of a body, in addition to its model.
struct BodyFrame {
  double rate_hz = 0.0;
  std::vector<Vec3> microphones_m;  // from the listener
  int max_strikes = 0, max_forces = 0;
  int max_waypoints = 0;
  double longest_m = 0.0;
  double silence_pa = 1e-10;
  Isa isa = Isa::kBest;
  ContactSurface surface{};
  bool audits_energy = false;
  std::optional<Floor> floor = std::nullopt;
  std::optional<ListeningHead> head = std::nullopt;
  int phase = 0;  // of Directivity
};

/// Memory by effect. That of lasting contacts counts as roughness here, for any of their three effects.
using EffectBytes = PerEffect<std::int64_t>;

/// The acceleration noise of a body with its attitude.
struct BodyAccelerationNoise {
  AccelerationNoise noise;
  Attitude attitude;
  std::int64_t first = 0;  // sample of the scene with which it began
};

/// Modules on their way into a body, or replaced ones on their way out. Made and destroyed on the main thread.
struct BodyChange {
  EffectSet effects;
  std::unique_ptr<Voice> voice;
  std::unique_ptr<BodyAccelerationNoise> acceleration_noise;
  std::unique_ptr<Propagation> propagation;
  std::unique_ptr<ContactForces> contacts;
  ContactSurface surface;                    // with the material of the model
  bool inherits = false;                     // replaces voice, contacts and acceleration_noise of the body
  std::unique_ptr<VoiceHandover> handover;   // for the voice
  std::unique_ptr<Directivity> directivity;  // of the voice, for the propagation in place

  EffectBytes calc_bytes() const;
};

/// Records of lasting contacts.
struct ContactRecordCounters {
  std::int64_t accepted = 0, refused = 0, dropped = 0, thinned = 0;  // ContactCounters
  std::int64_t without_use = 0;                                      // for a body without an effect of contacts
};

/// Work of a body by effect, in the units of EffectCounters, and measured ticks.
struct BodyWork {
  PerEffect<std::int64_t> units{};
  PerEffect<std::int64_t> ticks{};
  std::int64_t strikes = 0, refused = 0, late = 0, resets = 0;
  float peak_pa = 0.0F;
  double deflection = 0.0, energy_rise = 0.0;  // VoiceCounters
  ModeEnergy energy;
};

using TickFunction = std::uint64_t (*)() noexcept;

/// Room for one block of a body's sound, shared by all bodies.
struct BodyScratch {
  std::array<float, kBlock> mono{};
  std::array<std::array<float, kBlock>, 3> dipole{};
  std::array<double, kBlock> heard{};
  std::array<std::array<double, kBlock>, 2> by_head{};
};

using Mix = std::vector<std::array<double, kBlock>>;  // per microphone

/// The level of a propagation over a block. kUnheard: its sound is made and dropped.
enum class Fade : std::uint8_t { kNone, kIn, kOut, kUnheard };

/// Invariant: it has the modules of its effects and no others; every module has done the same samples (rendered_); while a change
/// is under way the old and the new propagation sound together, and one fades into the other within one block. [main-thread] makes modules,
/// [audio-thread] puts them in.
class SoundingBody {
 public:
  /// Without any effects: apply() brings them. Takes memory for its way. [main-thread]
  SoundingBody(std::shared_ptr<const Model> model, BodyFrame frame, const Vec3& position_m, const events::Quaternion& rotation);

  /// The modules that a body of effects `from` lacks for `to`, and with another model those that take the place of all that know the old
  /// one; `model` is what the body has from then on. Throws as check() does. [main-thread]
  std::unique_ptr<BodyChange> make_change(EffectSet from, EffectSet to, std::shared_ptr<const Model> model);
  std::unique_ptr<BodyChange> make_change(EffectSet from, EffectSet to) { return make_change(from, to, model_); }
  /// Throws InputError for effects that this build or a body of this model cannot have. [main-thread]
  static void check(EffectSet effects, const Model& model);
  void check(EffectSet effects) const { check(effects, *model_); }

  /// All that follows: [audio-thread], no heap, no lock, no throw.

  /// The change begins with this sample, the first of a block; it is over when finish_change() says so.
  void apply(BodyChange& change, const ListenerTracks& listener, std::int64_t sample) noexcept;
  /// At the first sample of a block: the change that is over now, with the modules that are not needed any more; or nullptr.
  BodyChange* finish_change(const ListenerTracks& listener, std::int64_t sample) noexcept;

  /// `sample`: the first that is not rendered. False when no effect could take it.
  bool take(const events::Impulse& impulse, std::int64_t sample) noexcept;
  bool take(const events::Force& force, std::int64_t sample) noexcept;
  /// `other`: the surface of the other body.
  bool take(const events::LastingContact& contact, const ContactSurface& other, std::int64_t sample,
            ContactRecordCounters& counters) noexcept;
  bool take(const events::BodyMotion& motion) noexcept;

  /// Adds its sound at the microphones to `mix`, for samples `sample` to `sample + count`, all of one block.
  void render(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch, Mix& mix,
              TickFunction ticks) noexcept;

  /// Nothing sounds, nothing is under way, nothing is to come: until the next event render() would add nothing.
  bool is_asleep() const noexcept;
  /// Nothing earlier will come. For bodies that are awake, before render().
  void reach(double time_s) noexcept;
  const ContactSurface& get_surface() const noexcept { return surface_; }  // as others feel it
  const BodyWork& get_work() const { return work_; }
  /// Its modes; nullptr without.
  Voice* get_voice() noexcept { return voice_.get(); }
  const Voice* get_voice() const noexcept { return voice_.get(); }
  /// True with Directivity, also during a change to it or from it.
  bool is_directed() const noexcept;
  /// At the first sample of a block: transfers that it needs, TransferBudget; then its share of them.
  int find_transfer_need(std::int64_t sample) noexcept;
  void set_transfer_share(const TransferBudget& budget) noexcept;
  /// Pressure at the nearest microphone for 1 Pa at 1 m, at a sample.
  float calc_nearness(const ListenerTracks& listener, std::int64_t sample) const noexcept;

 private:
  template <class Strike>
  bool play(const Strike& strike, bool has_length, bool is_new, std::int64_t sample) noexcept;
  void wake(std::int64_t sample) noexcept;
  void put_contacts(BodyChange& change) noexcept;
  PropagationOptions make_propagation_options() const;
  void direct_voice() noexcept;
  Effect make_modal_sound(std::span<float> mono) noexcept;
  void begin_directed_block(std::int64_t sample, const ListenerTracks& listener) noexcept;
  void make_acceleration_noise(const std::array<std::span<float>, 3>& dipole) noexcept;
  void make_sound(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch,
                  TickFunction ticks) noexcept;
  void hear(Propagation& propagation, std::int64_t sample, std::size_t count, const ListenerTracks& listener, Fade fade,
            BodyScratch& scratch, Mix& mix, TickFunction ticks) noexcept;
  int hear_ear(Receiver& ear, const Source& source, const Trajectory& track, std::size_t microphone, double level, std::int64_t sample,
               std::size_t count, Fade fade, bool apart, BodyScratch& scratch, Mix& mix) noexcept;
  void hear_by_head(Propagation& propagation, std::int64_t sample, std::size_t count, const ListenerTracks& listener, Fade fade,
                    BodyScratch& scratch, Mix& mix, TickFunction ticks) noexcept;
  void count_ear(const Propagation& propagation, Effect sends, std::size_t microphone, bool is_mirrored, int moved, std::size_t count,
                 std::int64_t ticks) noexcept;
  bool is_filled(const Propagation& propagation, const ListenerTracks& listener, std::int64_t sample) const noexcept;

  std::shared_ptr<const Model> model_;  // the main thread's
  BodyFrame frame_;
  Trajectory track_;
  double turned_s_ = 0.0;  // of rotation_
  events::Quaternion rotation_{1.0, 0.0, 0.0, 0.0};
  EffectSet effects_;
  std::unique_ptr<Voice> voice_;
  std::unique_ptr<BodyAccelerationNoise> acceleration_noise_;
  std::unique_ptr<ContactForces> contacts_;  // attached to voice_
  ContactSurface surface_;                   // with the material of the model
  std::unique_ptr<Propagation> propagation_, next_propagation_;
  BodyChange* change_ = nullptr;
  bool fading_ = false;        // from propagation_ to next_propagation_, in this block
  std::int64_t first_ = 0;     // sample of the scene with which the voice began
  std::int64_t rendered_ = 0;  // samples of the scene that all modules have done
  int transfer_need_ = 0;
  BodyWork work_;
};

}  // namespace carillon::synth

// One body of a Synthesiser: the modules that its effects need.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
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
#include "runtime/synth/resonator_bank.hpp"
#include "runtime/synth/trajectory.hpp"
#include "runtime/synth/transfer_budget.hpp"

namespace carillon::synth {

/// The surroundings and limits of a body, in addition to its model.
struct BodyFrame {
  PropagationOptions propagation;
  int max_strikes = 0, max_forces = 0;
  double silence_pa = 1e-10;
  Isa isa = Isa::kBest;
  ContactSurface surface{};
  float gain = 1.0F;  // factor of its pressure
  bool audits_energy = false;
};

/// The acceleration noise of a body with its attitude.
struct BodyAccelerationNoise {
  AccelerationNoise noise;
  Attitude attitude;
};

/// Modules of another model for a playing body; after the exchange those of the old model. Made and destroyed on the main thread.
struct ModelSwap {
  std::unique_ptr<ResonatorBank> modes;  // none without modes, likewise the others
  std::unique_ptr<ModeHandover> handover;
  std::unique_ptr<BodyAccelerationNoise> acceleration_noise;
  std::unique_ptr<ContactForces> contacts;
  std::unique_ptr<DirectedSound> directed;
  ContactSurface surface;  // with the moduli of the model
};

/// Records of lasting contacts.
struct ContactRecordCounters {
  std::int64_t accepted = 0, refused = 0, dropped = 0, thinned = 0;  // ContactCounters
  std::int64_t without_use = 0;                                      // for a body without an effect of contacts
};

/// Work of a body; by effect in the units of EffectCounters.
struct BodyWork {
  PerEffect<std::int64_t> units{};
  std::int64_t strikes = 0, refused = 0, late = 0, resets = 0;
  float peak_pa = 0.0F;
  double deflection = 0.0, energy_rise = 0.0;  // ResonatorCounters
  ModeEnergy energy;
};

/// Buffers for one block of a body's sound, shared by all bodies.
struct BodyScratch {
  std::array<float, kBlock> mono{};
  std::array<std::array<float, kBlock>, 3> dipole{};
  std::array<double, kBlock> heard{};
};

using Mix = std::vector<std::array<double, kBlock>>;  // per microphone

/// Fade of one receiver over a block.
enum class Fade : std::uint8_t { kNone, kIn, kOut };

/// Invariant: the body has exactly the modules of its effects, and every module has done the same samples (rendered_). The effects are
/// those of the constructor. In the block of a model swap the receivers of the old directed sound fade into those of the new one.
class SoundingBody {
 public:
  /// Allocates all modules. Throws as check() does. [main-thread]
  SoundingBody(std::shared_ptr<const Model> model, BodyFrame frame, EffectSet effects, const Vec3& position_m,
               const events::Quaternion& rotation);

  EffectSet get_effects() const noexcept { return effects_; }
  /// Throws InputError for a model without the data for the effects. [main-thread]
  void check(const Model& model) const;
  /// [main-thread]
  const std::shared_ptr<const Model>& get_model() const noexcept { return model_; }
  /// For its first sensor; only with Effect::kModal. [main-thread]
  std::unique_ptr<BodySensors> make_sensors() const;
  /// Modules of a checked model, which the body has from then on. [main-thread]
  std::unique_ptr<ModelSwap> make_swap(std::shared_ptr<const Model> model);

  /// All that follows: [audio-thread], no heap, no lock, no throw.

  /// The first sample of the body's sound, the first of a block.
  void begin(const ListenerTracks& listener, std::int64_t sample) noexcept;
  /// Exchanges the modules, at the first sample of a block; the swap is in use until finish_swap() returns it.
  void apply(ModelSwap& swap, const ListenerTracks& listener, std::int64_t sample) noexcept;
  /// At the first sample of a block: the swap that is over, with the old modules; or nullptr.
  ModelSwap* finish_swap(std::int64_t sample) noexcept;

  /// At the first sample of a block: one more sensor, of `sensors`, which are made by make_sensors().
  void sense(BodySensors& sensors, Sensor& sensor, std::int64_t sample) noexcept;
  /// After render(), also of a body that sleeps: passes on the sensors' samples.
  void finish_sensors(int samples) noexcept { sensors_->finish(samples); }
  bool has_sensors() const noexcept { return sensors_ != nullptr; }

  /// `sample`: the first that is not rendered. False when no effect could take it.
  bool take(const events::Impulse& impulse, std::int64_t sample) noexcept;
  bool take(const events::Force& force, std::int64_t sample) noexcept;
  /// `other`: the surface of the other body.
  bool take(const events::LastingContact& contact, const ContactSurface& other, std::int64_t sample,
            ContactRecordCounters& counters) noexcept;
  bool take(const events::BodyMotion& motion) noexcept;

  /// Adds its sound at the microphones to `mix`, for samples `sample` to `sample + count`, all of one block.
  void render(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch, Mix& mix) noexcept;

  /// Until the next event render() would add nothing.
  bool is_asleep() const noexcept;
  /// Nothing earlier will come. For bodies that are awake, before render().
  void reach(double time_s) noexcept;
  const ContactSurface& get_surface() const noexcept { return surface_; }  // as others feel it
  const BodyWork& get_work() const { return work_; }
  /// Its modes; nullptr without.
  ResonatorBank* get_modes() noexcept { return modes_.get(); }
  const ResonatorBank* get_modes() const noexcept { return modes_.get(); }
  bool is_directed() const noexcept { return propagation_ && propagation_->directed; }
  /// For directed bodies, at the first sample of a block: transfers that it needs (TransferBudget); then its share of them.
  int find_transfer_need(std::int64_t sample) noexcept;
  void set_transfer_share(const TransferBudget& budget) noexcept;
  /// Pressure at the nearest microphone for 1 Pa at 1 m, at a sample.
  float calc_nearness(const ListenerTracks& listener, std::int64_t sample) const noexcept;

 private:
  events::BodyMotion find_before(const events::BodyMotion& jump) const noexcept;
  template <class Strike>
  bool play(const Strike& strike, bool has_length, bool is_new, std::int64_t sample) noexcept;
  void wake(std::int64_t sample) noexcept;
  double calc_own_s(double time_s) const noexcept;
  std::unique_ptr<ResonatorBank> make_modes(const std::shared_ptr<const Model>& model) const;
  std::unique_ptr<BodyAccelerationNoise> make_noise(const Model& model) const;
  std::unique_ptr<ContactForces> make_contacts(const std::shared_ptr<const Model>& model, const ContactSurface& surface) const;
  ContactSurface make_surface(const Model& model) const;
  void amplify(std::span<float> sound) const noexcept;  // by its gain
  void make_modal_sound(std::span<float> mono) noexcept;
  void count_modal_work(const ResonatorCounters& before, std::int64_t contact_samples, std::span<const float> mono) noexcept;
  void begin_directed_block(std::int64_t sample, const ListenerTracks& listener) noexcept;
  void begin_directed(DirectedSound& directed, const ListenerTracks& listener, std::int64_t sample) noexcept;
  void make_acceleration_noise(const std::array<std::span<float>, 3>& dipole) noexcept;
  void make_sound(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch) noexcept;
  void hear(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch, Mix& mix) noexcept;
  int hear_ear(Receiver& ear, const Source& source, const Trajectory& track, std::size_t microphone, double level, std::int64_t sample,
               std::size_t count, Fade fade, BodyScratch& scratch, Mix& mix) noexcept;
  void hear_directed(DirectedSound& directed, std::int64_t sample, std::size_t count, const ListenerTracks& listener, Fade fade,
                     BodyScratch& scratch, Mix& mix) noexcept;
  void hear_by_head(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch, Mix& mix) noexcept;
  void count_ear(std::size_t microphone, bool is_mirrored, int moved, std::size_t count) noexcept;

  std::shared_ptr<const Model> model_;  // main thread
  BodyFrame frame_;
  EffectSet effects_;
  Trajectory track_;
  double turned_s_ = 0.0;  // of rotation_
  events::Quaternion rotation_{1.0, 0.0, 0.0, 0.0};
  std::unique_ptr<ResonatorBank> modes_;
  std::unique_ptr<BodyAccelerationNoise> acceleration_noise_;
  std::unique_ptr<ContactForces> contacts_;  // attached to modes_
  BodySensors* sensors_ = nullptr;           // nullptr: none
  ContactSurface surface_;                   // with the material of the model
  std::unique_ptr<Propagation> propagation_;
  ModelSwap* swap_ = nullptr;    // in its block
  std::int64_t swap_begin_ = 0;  // first sample of that block
  std::int64_t first_ = 0;       // sample of the scene with which the modules began
  std::int64_t rendered_ = 0;    // samples of the scene that all modules have done
  int transfer_need_ = 0;
  BodyWork work_;
};

}  // namespace carillon::synth

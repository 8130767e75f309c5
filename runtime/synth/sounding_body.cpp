// Method:     modes and acceleration noise fill delay lines, which receivers read. A change of effects that touches the propagation makes
//             a second one: both are fed until the new one holds all that its receivers read, then one fades into the other within a
//             block, and the old one and the modules that are inaudible go back to the main thread.
// Source:     none.
// Deviations: none.
#include "runtime/synth/sounding_body.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "runtime/base/error.hpp"

namespace carillon::synth {
namespace {

constexpr EffectSet kOfPropagation{Effect::kModal, Effect::kAccelerationNoise, Effect::kAirDelay, Effect::kDoppler, Effect::kTwoEars};

/// Whether a build and a body have an effect: false without a look where the build has not.
constexpr bool has(EffectSet effects, Effect effect) { return kCompiledEffects.has(effect) && effects.has(effect); }

constexpr EffectSet kOfContacts = kContactEffects.common(kCompiledEffects);

/// Whether lasting contacts do anything: they act on modes.
constexpr bool needs_contacts(EffectSet effects) { return has(effects, Effect::kModal) && effects.has_any(kOfContacts); }

/// The first of a set, or another where it is empty.
constexpr Effect find_first(EffectSet effects, Effect otherwise) { return effects.is_empty() ? otherwise : *effects.begin(); }

std::unique_ptr<Propagation> make_propagation(EffectSet effects, const BodyFrame& frame) {
  auto propagation = std::make_unique<Propagation>();
  propagation->effects = effects;
  const double longest_m = effects.has(Effect::kAirDelay) ? frame.longest_m : 0.0;
  const auto make_history = [&] { return std::make_unique<DelayLine>(longest_m, frame.rate_hz, kBlock); };
  if (effects.has(Effect::kModal)) propagation->monopole = make_history();
  propagation->source.monopole = propagation->monopole.get();
  for (std::size_t k = 0; k < 3 && effects.has(Effect::kAccelerationNoise); ++k) {
    propagation->dipole[k] = make_history();
    propagation->source.dipole[k] = propagation->dipole[k].get();
  }
  if (effects.has(Effect::kTwoEars)) {
    propagation->ears.reserve(frame.microphones_m.size());
    for (const Vec3& place : frame.microphones_m) propagation->ears.emplace_back(place, frame.rate_hz, effects);
  } else {
    propagation->ears.emplace_back(calc_middle(frame.microphones_m), frame.rate_hz, effects);
  }
  return propagation;
}

/// Of a propagation's ear, which stands for all microphones where the body is heard without two ears.
const Trajectory& find_ear_track(const Propagation& propagation, const ListenerTracks& listener, std::size_t ear) noexcept {
  return has(propagation.effects, Effect::kTwoEars) ? listener.get_track(ear) : listener.get_middle_track();
}

}  // namespace

bool Propagation::is_silent() const noexcept {
  if (monopole && !monopole->is_silent()) return false;
  return !dipole[0] || (dipole[0]->is_silent() && dipole[1]->is_silent() && dipole[2]->is_silent());
}

EffectBytes BodyChange::calc_bytes() const {
  EffectBytes bytes;
  if (voice) bytes[Effect::kModal] += static_cast<std::int64_t>(voice->calc_bytes());
  if (acceleration_noise) {
    bytes[Effect::kAccelerationNoise] +=
        static_cast<std::int64_t>(sizeof(BodyAccelerationNoise) - sizeof(AccelerationNoise) + acceleration_noise->noise.calc_bytes() +
                                  acceleration_noise->attitude.get_bytes());
  }
  if (contacts) bytes[Effect::kRoughness] += static_cast<std::int64_t>(contacts->calc_bytes());
  if (!propagation) return bytes;
  // What a delay line holds beyond one without travel time belongs to the travel time.
  const DelayLine still(0.0, 1.0, kBlock);
  const auto add = [&](const DelayLine& delay_line, Effect effect) {
    bytes[effect] += static_cast<std::int64_t>(sizeof(DelayLine) + still.get_bytes());
    bytes[Effect::kAirDelay] += static_cast<std::int64_t>(delay_line.get_bytes() - still.get_bytes());
  };
  if (propagation->monopole) add(*propagation->monopole, Effect::kModal);
  for (const auto& delay_line : propagation->dipole)
    if (delay_line) add(*delay_line, Effect::kAccelerationNoise);
  const Effect source = propagation->monopole ? Effect::kModal : Effect::kAccelerationNoise;
  bytes[source] += static_cast<std::int64_t>(sizeof(Propagation) + sizeof(Receiver));
  bytes[Effect::kTwoEars] += static_cast<std::int64_t>((propagation->ears.size() - 1) * sizeof(Receiver));
  return bytes;
}

SoundingBody::SoundingBody(std::shared_ptr<const Model> model, BodyFrame frame, const Vec3& position_m, const events::Quaternion& rotation)
    : model_(std::move(model)), frame_(std::move(frame)), track_(static_cast<std::size_t>(frame_.max_waypoints)), rotation_(rotation) {
  track_.push({.position_m = position_m});
  surface_ = frame_.surface;
}

void SoundingBody::check(EffectSet effects, const Model& model) {
  check_compiled(effects);
  if (!effects.has(Effect::kAccelerationNoise)) return;
  if (!(model.get_sphere_radius_m() > 0.0 && model.get_mass_kg() > 0.0))
    throw InputError("acceleration_noise needs a body with a mass and a volume; the bank of this one gives none");
}

std::unique_ptr<BodyChange> SoundingBody::make_change(EffectSet from, EffectSet to, std::shared_ptr<const Model> model) {
  check(to, *model);
  auto change = std::make_unique<BodyChange>();
  change->effects = to;
  change->inherits = model != model_;
  const auto lacks = [&](Effect effect) { return to.has(effect) && (change->inherits || !from.has(effect)); };
  if (lacks(Effect::kModal)) {
    change->voice = std::make_unique<Voice>(model, VoiceOptions{.max_strikes = frame_.max_strikes,
                                                                .max_forces = frame_.max_forces,
                                                                .silence_pa = frame_.silence_pa,
                                                                .isa = frame_.isa,
                                                                .audits_energy = frame_.audits_energy});
    if (change->inherits && from.has(Effect::kModal)) change->handover = std::make_unique<VoiceHandover>(*model_, *model);
  }
  if (lacks(Effect::kAccelerationNoise)) {
    change->acceleration_noise = std::make_unique<BodyAccelerationNoise>(BodyAccelerationNoise{
        AccelerationNoise(model->get_sphere_radius_m(), model->get_mass_kg(), frame_.rate_hz, frame_.max_strikes, frame_.max_forces),
        Attitude(static_cast<std::size_t>(frame_.max_waypoints))});
  }
  change->modulus_pa = frame_.surface.modulus_pa > 0.0 ? frame_.surface.modulus_pa : model->get_plane_strain_modulus_pa();
  if (needs_contacts(to) && (change->inherits || !needs_contacts(from))) {
    change->contacts = std::make_unique<ContactForces>(model, ContactForcesOptions{.surface = frame_.surface, .effects = to});
  }
  const bool sounds = to.has(Effect::kModal) || to.has(Effect::kAccelerationNoise);
  if (to.common(kOfPropagation) != from.common(kOfPropagation) && sounds) change->propagation = make_propagation(to, frame_);
  model_ = std::move(model);
  return change;
}

void SoundingBody::apply(BodyChange& change, const ListenerTracks& listener, std::int64_t sample) noexcept {
  if (is_asleep()) wake(sample);
  rendered_ = sample;
  change_ = &change;
  effects_ = change.effects;
  if (change.voice) {
    if (voice_ && change.handover)
      change.voice->take_over(*voice_, *change.handover);
    else
      first_ = sample;
    std::swap(voice_, change.voice);
  }
  if (change.acceleration_noise) {
    if (acceleration_noise_ && change.inherits) {
      change.acceleration_noise->noise.take_over(acceleration_noise_->noise);
      std::swap(change.acceleration_noise->attitude, acceleration_noise_->attitude);
      change.acceleration_noise->first = acceleration_noise_->first;
      std::swap(acceleration_noise_, change.acceleration_noise);
    } else {
      std::swap(acceleration_noise_, change.acceleration_noise);
      acceleration_noise_->first = sample;
      acceleration_noise_->attitude.push(turned_s_, rotation_);
    }
  }
  surface_.modulus_pa = change.modulus_pa;
  put_contacts(change);
  if (!change.propagation) return;
  std::swap(next_propagation_, change.propagation);
  next_propagation_->source.track = &track_;
  next_propagation_->first = sample;
  if (next_propagation_->monopole) next_propagation_->monopole->push_silence(sample);
  for (const auto& delay_line : next_propagation_->dipole)
    if (delay_line) delay_line->push_silence(sample);
  for (std::size_t m = 0; m < next_propagation_->ears.size(); ++m)
    next_propagation_->ears[m].begin(next_propagation_->source, find_ear_track(*next_propagation_, listener, m), sample);
}

/// Contacts begin, change what they do, or fall.
void SoundingBody::put_contacts(BodyChange& change) noexcept {
  if (kOfContacts.is_empty()) return;
  if (change.contacts) {
    if (contacts_ && change.inherits) change.contacts->take_over(*contacts_);
    std::swap(contacts_, change.contacts);
    voice_->attach(contacts_.get());
  } else if (contacts_ && needs_contacts(effects_)) {
    contacts_->set_effects(effects_);
  } else if (contacts_ && change.inherits) {  // of the old model
    change.contacts = std::move(contacts_);
  } else if (contacts_) {
    contacts_->release();
  }
}

/// Whether the receivers of a new propagation find in its delay lines all that the old one could have given them.
bool SoundingBody::is_filled(const Propagation& propagation, const ListenerTracks& listener, std::int64_t sample) const noexcept {
  if (!propagation_ || propagation_->is_silent()) return true;
  const std::int64_t filled = sample - propagation.first;
  const DelayLine& delay_line = propagation.monopole ? *propagation.monopole : *propagation.dipole[0];
  double longest_s = 0.0;
  if (has(propagation.effects, Effect::kAirDelay)) {
    for (std::size_t m = 0; m < propagation.ears.size(); ++m) {
      const Trajectory& track = find_ear_track(propagation, listener, m);
      longest_s = std::max(longest_s, propagation.ears[m].calc_delay_s(propagation.source, track, sample));
    }
  }
  const double needed = longest_s * frame_.rate_hz + Receiver::kLatency + kTaps + kBlock;
  return static_cast<double>(filled) >= needed || filled >= delay_line.get_size();
}

BodyChange* SoundingBody::finish_change(const ListenerTracks& listener, std::int64_t sample) noexcept {
  if (change_ == nullptr) return nullptr;
  const bool sounds = has(effects_, Effect::kModal) || has(effects_, Effect::kAccelerationNoise);
  if (contacts_ && !needs_contacts(effects_) && !contacts_->is_idle()) return nullptr;  // they fall first
  if (!fading_ && (next_propagation_ || (!sounds && propagation_))) {
    // The old propagation continues until the new one can take over; with nothing to be heard it does so at once.
    fading_ = next_propagation_ == nullptr || is_filled(*next_propagation_, listener, sample);
    const bool is_heard = propagation_ && !(propagation_->is_silent() && (!voice_ || voice_->is_idle()) &&
                                            (!acceleration_noise_ || acceleration_noise_->noise.is_idle()));
    if (is_heard) return nullptr;
  }
  fading_ = false;
  if (next_propagation_ || !sounds) change_->propagation = std::exchange(propagation_, std::move(next_propagation_));
  if (contacts_ && !needs_contacts(effects_)) {
    voice_->attach(nullptr);
    change_->contacts = std::move(contacts_);
  }
  if (!has(effects_, Effect::kModal)) change_->voice = std::move(voice_);
  if (!has(effects_, Effect::kAccelerationNoise)) change_->acceleration_noise = std::move(acceleration_noise_);
  return std::exchange(change_, nullptr);
}

float SoundingBody::calc_nearness(const ListenerTracks& listener, std::int64_t sample) const noexcept {
  const double time_s = static_cast<double>(sample) / frame_.rate_hz;
  const Vec3 here = track_.find(time_s).position_m;
  double nearest = std::numeric_limits<double>::infinity();  // squared
  for (std::size_t m = 0; m < frame_.microphones_m.size(); ++m) {
    const Vec3 there = listener.get_track(m).find(time_s).position_m, place = frame_.microphones_m[m];
    double square = 0.0;
    for (std::size_t k = 0; k < 3; ++k) square += (there[k] + place[k] - here[k]) * (there[k] + place[k] - here[k]);
    nearest = std::min(nearest, square);
  }
  return static_cast<float>(1.0 / std::max(std::sqrt(nearest), kNearestM));
}

bool SoundingBody::is_asleep() const noexcept {
  return change_ == nullptr && (!propagation_ || propagation_->is_silent()) && (!voice_ || voice_->is_idle()) &&
         (!acceleration_noise_ || acceleration_noise_->noise.is_idle());
}

/// Lets the modules of a body that slept catch up.
void SoundingBody::wake(std::int64_t sample) noexcept {
  const std::int64_t slept = sample - rendered_;
  if (slept <= 0) return;
  rendered_ = sample;
  if (voice_) voice_->skip(slept);
  if (acceleration_noise_) acceleration_noise_->noise.skip(slept);
  if (!propagation_) return;
  if (propagation_->monopole) propagation_->monopole->push_silence(slept);
  for (const auto& delay_line : propagation_->dipole)
    if (delay_line) delay_line->push_silence(slept);
}

bool SoundingBody::take(const events::Impulse& impulse, std::int64_t sample) noexcept {
  events::Impulse own = impulse;
  if (!has(effects_, Effect::kHertzPulse)) own.duration_s = 0.0;
  return play(own, own.duration_s > 0.0, true, sample);
}

bool SoundingBody::take(const events::Force& force, std::int64_t sample) noexcept {
  if (has(effects_, Effect::kHertzPulse)) return play(force, true, !force.continues, sample);
  return play(events::to_impulse(force), false, !force.continues, sample);
}

/// To a voice or an acceleration noise.
template <class Player, class... Attitudes>
bool hit(Player& player, const events::Impulse& impulse, const Attitudes&... attitude) noexcept {
  return player.strike(impulse, attitude...);
}
template <class Player, class... Attitudes>
bool hit(Player& player, const events::Force& force, const Attitudes&... attitude) noexcept {
  return player.push(force, attitude...);
}

/// To all who play pulses. What continues a pulse is no strike of its own.
template <class Strike>
bool SoundingBody::play(const Strike& strike, bool has_length, bool is_new, std::int64_t sample) noexcept {
  wake(sample);
  Strike own = strike;
  bool is_taken = false, is_refused = false;
  if (has(effects_, Effect::kModal) && voice_) {
    own.time_s = strike.time_s - static_cast<double>(first_) / frame_.rate_hz;
    const std::int64_t late = voice_->get_counters().late;
    (hit(*voice_, own) ? is_taken : is_refused) = true;
    if (is_new) work_.late += voice_->get_counters().late - late;
  }
  if (has(effects_, Effect::kAccelerationNoise) && acceleration_noise_) {
    own.time_s = strike.time_s - static_cast<double>(acceleration_noise_->first) / frame_.rate_hz;
    (hit(acceleration_noise_->noise, own, acceleration_noise_->attitude.find(strike.time_s)) ? is_taken : is_refused) = true;
  }
  if (is_taken) {
    work_.strikes += static_cast<std::int64_t>(is_new);
    if (has_length) ++work_.units[Effect::kHertzPulse];
  }
  if (is_refused) ++work_.refused;
  return is_taken;
}

bool SoundingBody::take(const events::LastingContact& contact, const ContactSurface& other, std::int64_t sample) noexcept {
  if (!needs_contacts(effects_) || !contacts_) return false;
  wake(sample);
  events::LastingContact own = contact;
  own.time_s -= static_cast<double>(first_) / frame_.rate_hz;
  const std::int64_t refused = contacts_->get_counters().refused;
  const bool is_taken = contacts_->take(own, other);
  work_.refused += contacts_->get_counters().refused - refused;
  return is_taken;
}

void SoundingBody::reach(double time_s) noexcept {
  if (!kOfContacts.is_empty() && contacts_) contacts_->reach(time_s - static_cast<double>(first_) / frame_.rate_hz);
}

bool SoundingBody::take(const events::BodyMotion& motion) noexcept {
  if (!track_.push({motion.time_s, motion.position_m, motion.velocity_m_s})) return false;
  turned_s_ = motion.time_s;
  rotation_ = motion.rotation;
  if (kCompiledEffects.has(Effect::kAccelerationNoise) && acceleration_noise_)
    acceleration_noise_->attitude.push(motion.time_s, motion.rotation);
  return true;
}

/// Modes and acceleration noise, into all delay lines.
/// The modes' sound, into the delay lines. Returns the effect to which its time counts.
Effect SoundingBody::make_modal_sound(std::span<float> mono) noexcept {
  const bool is_idle = voice_->is_idle();
  Effect acts = Effect::kModal;
  if (is_idle) {
    voice_->skip(static_cast<std::int64_t>(mono.size()));
  } else {
    std::fill(mono.begin(), mono.end(), 0.0F);
    const VoiceCounters before = voice_->get_counters();
    const bool touched = !kOfContacts.is_empty() && contacts_ && !contacts_->is_resting();
    const std::int64_t contact_samples = touched ? contacts_->get_counters().samples : 0;
    voice_->process(mono);
    const VoiceCounters after = voice_->get_counters();
    work_.resets += after.resets - before.resets;
    work_.energy_rise = std::max(work_.energy_rise, after.energy_rise);
    work_.radiated_j += after.radiated_j - before.radiated_j;
    work_.units[Effect::kModal] += after.mode_samples - before.mode_samples;
    if (touched) {
      const std::int64_t textured = contacts_->get_counters().samples - contact_samples;
      if (has(effects_, Effect::kRoughness)) work_.units[Effect::kRoughness] += textured;
      if (has(effects_, Effect::kRolling)) work_.units[Effect::kRolling] += textured;
      if (has(effects_, Effect::kContactDamping)) work_.units[Effect::kContactDamping] += static_cast<std::int64_t>(mono.size());
      acts = find_first(effects_.common(kOfContacts), Effect::kModal);
    }
    for (const float p : mono) work_.peak_pa = std::max(work_.peak_pa, std::abs(p));
  }
  for (Propagation* path : {propagation_.get(), next_propagation_.get()}) {
    if (path == nullptr || !path->monopole) continue;
    if (is_idle)
      path->monopole->push_silence(static_cast<std::int64_t>(mono.size()));
    else
      path->monopole->push(mono);
  }
  return acts;
}

/// The three dipoles of the body as a whole, into the delay lines.
void SoundingBody::make_acceleration_noise(const std::array<std::span<float>, 3>& dipole) noexcept {
  AccelerationNoise& noise = acceleration_noise_->noise;
  const auto count = static_cast<std::int64_t>(dipole[0].size());
  const bool is_idle = noise.is_idle();
  if (is_idle) {
    noise.skip(count);
  } else {
    noise.process(dipole);
    int bad = 0;
    for (const std::span<float>& axis : dipole)
      for (const float p : axis) bad |= static_cast<int>(!(std::abs(p) <= std::numeric_limits<float>::max()));
    if (bad != 0) {
      noise.reset();
      for (const std::span<float>& axis : dipole) std::fill(axis.begin(), axis.end(), 0.0F);
      ++work_.resets;
    }
    work_.units[Effect::kAccelerationNoise] += count;
  }
  for (Propagation* path : {propagation_.get(), next_propagation_.get()}) {
    for (std::size_t k = 0; k < 3 && path != nullptr && path->dipole[k]; ++k) {
      if (is_idle)
        path->dipole[k]->push_silence(count);
      else
        path->dipole[k]->push(dipole[k]);
    }
  }
}

void SoundingBody::make_sound(std::size_t count, BodyScratch& scratch, TickFunction ticks) noexcept {
  std::uint64_t started = ticks != nullptr ? ticks() : 0;
  const auto end_part = [&](Effect effect) {
    if (ticks == nullptr) return;
    const std::uint64_t now = ticks();
    work_.ticks[effect] += static_cast<std::int64_t>(now - std::exchange(started, now));
  };
  if (kCompiledEffects.has(Effect::kModal) && voice_) end_part(make_modal_sound(std::span(scratch.mono).first(count)));
  if (kCompiledEffects.has(Effect::kAccelerationNoise) && acceleration_noise_) {
    std::array<std::span<float>, 3> dipole;
    for (std::size_t k = 0; k < 3; ++k) dipole[k] = std::span(scratch.dipole[k]).first(count);
    make_acceleration_noise(dipole);
    end_part(Effect::kAccelerationNoise);
  }
}

/// `fade`: 0 none, 1 in, -1 out.
void SoundingBody::hear(Propagation& propagation, std::int64_t sample, std::size_t count, const ListenerTracks& listener, int fade,
                        BodyScratch& scratch, Mix& mix, TickFunction ticks) noexcept {
  if (propagation.is_silent()) return;
  std::uint64_t started = ticks != nullptr ? ticks() : 0;
  const bool apart = has(propagation.effects, Effect::kTwoEars);
  const std::span<double> heard = std::span(scratch.heard).first(count);
  for (std::size_t m = 0; m < propagation.ears.size(); ++m) {
    const Trajectory& track = find_ear_track(propagation, listener, m);
    int moved = 0;
    if (apart && fade == 0) {
      moved = propagation.ears[m].process(propagation.source, track, sample, std::span(mix[m]).first(count));
    } else {
      std::fill(heard.begin(), heard.end(), 0.0);
      moved = propagation.ears[m].process(propagation.source, track, sample, heard);
      const auto begin = static_cast<int>(sample % kBlock);
      for (std::size_t n = 0; n < count && fade != 0; ++n) {
        const double u = (begin + static_cast<int>(n)) / static_cast<double>(kBlock), in = u * u * (3.0 - 2.0 * u);
        heard[n] *= fade > 0 ? in : 1.0 - in;
      }
      for (std::size_t c = apart ? m : 0; c < (apart ? m + 1 : mix.size()); ++c)
        for (std::size_t n = 0; n < count; ++n) mix[c][n] += heard[n];
    }
    if (has(propagation.effects, Effect::kAirDelay)) work_.units[Effect::kAirDelay] += static_cast<std::int64_t>(count);
    if (has(propagation.effects, Effect::kDoppler)) work_.units[Effect::kDoppler] += moved;
    if (m > 0) work_.units[Effect::kTwoEars] += static_cast<std::int64_t>(count);
    if (ticks == nullptr) continue;
    const std::uint64_t now = ticks();
    const Effect sends = propagation.monopole ? Effect::kModal : Effect::kAccelerationNoise;
    const Effect carries = moved > 0 ? Effect::kDoppler : has(propagation.effects, Effect::kAirDelay) ? Effect::kAirDelay : sends;
    work_.ticks[m > 0 ? Effect::kTwoEars : carries] += static_cast<std::int64_t>(now - std::exchange(started, now));
  }
}

void SoundingBody::render(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch, Mix& mix,
                          TickFunction ticks) noexcept {
  wake(sample);
  make_sound(count, scratch, ticks);
  if (propagation_) hear(*propagation_, sample, count, listener, fading_ ? -1 : 0, scratch, mix, ticks);
  if (next_propagation_ && fading_) hear(*next_propagation_, sample, count, listener, 1, scratch, mix, ticks);
  rendered_ = sample + static_cast<std::int64_t>(count);
}

}  // namespace carillon::synth

// One body: its effects, the events that act on it, and the sound that it sends.
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
#include "runtime/acoustics/radiation/transfers.hpp"

namespace carillon::synth {
namespace {

constexpr EffectSet kOfPropagation{Effect::kModal,   Effect::kAccelerationNoise, Effect::kAirDelay,         Effect::kDoppler,
                                   Effect::kTwoEars, Effect::kDirectivity,       Effect::kGroundReflection, Effect::kHead};

constexpr EffectSet kOfContacts = kContactEffects.common(kCompiledEffects);

/// True for effects of lasting contacts with modes, on which they act.
constexpr bool needs_contacts(EffectSet effects) { return has(effects, Effect::kModal) && effects.has_any(kOfContacts); }

/// The first of a set, or another where it is empty.
constexpr Effect find_first(EffectSet effects, Effect otherwise) { return effects.is_empty() ? otherwise : *effects.begin(); }

/// True for two models of a body with directivity with one sphere of multipoles.
bool has_same_sphere(const Model& a, const Model& b) {
  const ModelDirectivity &one = *a.get_directivity(), &other = *b.get_directivity();
  return one.offset_m == other.offset_m && one.transfers->get_radius_m() == other.transfers->get_radius_m();
}

}  // namespace

EffectBytes BodyChange::calc_bytes() const {
  EffectBytes bytes;
  if (voice) {
    const auto nonlinear = static_cast<std::int64_t>(voice->calc_nonlinear_bytes());
    bytes[Effect::kModal] += static_cast<std::int64_t>(voice->calc_bytes()) - nonlinear;
    const auto cascade = static_cast<std::int64_t>(voice->calc_cascade_bytes());
    bytes[Effect::kNonlinear] += nonlinear - cascade;
    bytes[Effect::kCascade] += cascade;
  }
  if (acceleration_noise) {
    bytes[Effect::kAccelerationNoise] +=
        static_cast<std::int64_t>(sizeof(BodyAccelerationNoise) - sizeof(AccelerationNoise) + acceleration_noise->noise.calc_bytes() +
                                  acceleration_noise->attitude.get_bytes());
  }
  if (directivity) bytes[Effect::kDirectivity] += static_cast<std::int64_t>(directivity->calc_bytes());
  if (contacts) bytes[Effect::kRoughness] += static_cast<std::int64_t>(contacts->calc_bytes());
  if (!propagation) return bytes;
  // The surplus of a delay line over one without travel time counts as travel time, or as the wait for a head.
  const std::size_t still = DelayLine::calc_least_bytes(kBlock);
  const Effect waits = propagation->effects.has(Effect::kAirDelay) ? Effect::kAirDelay : Effect::kModal;
  const auto add = [&](const DelayLine& delay_line, Effect effect) {
    bytes[effect] += static_cast<std::int64_t>(sizeof(DelayLine) + still);
    bytes[waits] += static_cast<std::int64_t>(delay_line.get_bytes() - still);
  };
  if (propagation->monopole) add(*propagation->monopole, Effect::kModal);
  for (const auto& delay_line : propagation->dipole)
    if (delay_line) add(*delay_line, Effect::kAccelerationNoise);
  const Effect source = propagation->monopole || propagation->directed ? Effect::kModal : Effect::kAccelerationNoise;
  bytes[source] += static_cast<std::int64_t>(sizeof(Propagation) + sizeof(Receiver));
  bytes[Effect::kTwoEars] += static_cast<std::int64_t>((propagation->ears.size() - 1) * sizeof(Receiver));
  bytes[Effect::kGroundReflection] += static_cast<std::int64_t>(propagation->mirrored.size() * sizeof(Receiver));
  for (const HeadEars& ears : propagation->head) bytes[Effect::kHead] += static_cast<std::int64_t>(ears.calc_bytes());
  if (!propagation->directed) return bytes;
  bytes[Effect::kDirectivity] += static_cast<std::int64_t>(propagation->directed->calc_bytes());
  for (const DelayLine& line : propagation->directed->get_lines()) {
    bytes[Effect::kDirectivity] += static_cast<std::int64_t>(still);
    bytes[waits] += static_cast<std::int64_t>(line.get_bytes() - still);
  }
  return bytes;
}

SoundingBody::SoundingBody(std::shared_ptr<const Model> model, BodyFrame frame, const Vec3& position_m, const events::Quaternion& rotation)
    : model_(std::move(model)), frame_(std::move(frame)), track_(static_cast<std::size_t>(frame_.max_waypoints)), rotation_(rotation) {
  track_.push({.position_m = position_m});
  surface_ = frame_.surface;
}

void SoundingBody::check(EffectSet effects, const Model& model) {
  check_compiled(effects);
  if (has(effects, Effect::kDirectivity) && model.get_directivity() == nullptr)
    throw InputError(
        "directivity needs a bank with multipoles, which this body's has not; make the bank with them, or leave the effect out");
  if (has(effects, Effect::kNonlinear) && model.get_nonlinear() == nullptr)
    throw InputError(
        "nonlinear needs a bank with a nonlinear energy, which this body's has not; make the bank with it, or leave the effect out");
  if (!effects.has(Effect::kAccelerationNoise)) return;
  if (!(model.get_sphere_radius_m() > 0.0 && model.get_mass_kg() > 0.0))
    throw InputError("acceleration_noise needs a body with a mass and a volume; the bank of this one gives none");
}

PropagationOptions SoundingBody::make_propagation_options() const {
  return {.rate_hz = frame_.rate_hz,
          .microphones_m = frame_.microphones_m,
          .longest_m = frame_.longest_m,
          .max_waypoints = frame_.max_waypoints,
          .floor = frame_.floor,
          .head = frame_.head,
          .phase = frame_.phase};
}

std::unique_ptr<BodyChange> SoundingBody::make_change(EffectSet from, EffectSet to, std::shared_ptr<const Model> model) {
  check(to, *model);
  auto change = std::make_unique<BodyChange>();
  change->effects = to;
  change->inherits = model != model_;
  const auto lacks = [&](Effect effect) { return to.has(effect) && (change->inherits || !from.has(effect)); };
  // Modes that large motion couples are in a voice of another make.
  const auto cascades = [](EffectSet effects, const Model& of) {
    return has(effects, Effect::kNonlinear) && has(effects, Effect::kCascade) && of.has_cascade();
  };
  const bool couples = has(to, Effect::kNonlinear) != has(from, Effect::kNonlinear) || cascades(to, *model) != cascades(from, *model_);
  if (lacks(Effect::kModal) || (couples && to.has(Effect::kModal))) {
    change->voice = std::make_unique<Voice>(model, VoiceOptions{.max_strikes = frame_.max_strikes,
                                                                .max_forces = frame_.max_forces,
                                                                .silence_pa = frame_.silence_pa,
                                                                .isa = frame_.isa,
                                                                .is_nonlinear = has(to, Effect::kNonlinear),
                                                                .has_cascade = cascades(to, *model),
                                                                .audits_energy = frame_.audits_energy});
    if ((change->inherits || couples) && from.has(Effect::kModal)) change->handover = std::make_unique<VoiceHandover>(*model_, *model);
  }
  if (lacks(Effect::kAccelerationNoise)) {
    change->acceleration_noise = std::make_unique<BodyAccelerationNoise>(BodyAccelerationNoise{
        AccelerationNoise(model->get_sphere_radius_m(), model->get_mass_kg(), frame_.rate_hz, frame_.max_strikes, frame_.max_forces),
        Attitude(static_cast<std::size_t>(frame_.max_waypoints))});
  }
  change->surface = complete(frame_.surface, model->get_plane_strain_modulus_pa(), model->get_wave_impedance_pa_s_m());
  if (needs_contacts(to) && (change->inherits || !needs_contacts(from))) {
    change->contacts = std::make_unique<ContactForces>(model, ContactForcesOptions{.surface = change->surface, .effects = to});
  }
  const bool sounds = to.has(Effect::kModal) || to.has(Effect::kAccelerationNoise);
  bool changes_air = to.common(kOfPropagation) != from.common(kOfPropagation);
  const auto is_directed = [](EffectSet effects) { return has(effects, Effect::kDirectivity) && effects.has(Effect::kModal); };
  if (change->inherits && is_directed(from)) {
    change->directivity = std::make_unique<Directivity>(model, count_ears(from, make_propagation_options()), frame_.phase);
    changes_air = changes_air || (is_directed(to) && !has_same_sphere(*model_, *model));
  }
  if (changes_air && sounds) change->propagation = make_propagation(to, make_propagation_options(), model);
  model_ = std::move(model);
  return change;
}

void SoundingBody::apply(BodyChange& change, const ListenerTracks& listener, std::int64_t sample) noexcept {
  if (is_asleep()) wake(sample);
  rendered_ = sample;
  change_ = &change;
  effects_ = change.effects;
  if (change.voice) {
    if (kCompiledEffects.has(Effect::kDirectivity) && change.directivity && propagation_ && propagation_->directed && change.handover) {
      // The propagation that is there continues with the modes of the new model.
      change.directivity->take_over(*propagation_->directed->weights, change.handover->get_old_modes());
      change.voice->direct(change.directivity.get(), nullptr);
      std::swap(propagation_->directed->weights, change.directivity);
    }
    if (voice_ && change.handover && !change.directivity) change.voice->direct_as(*voice_);
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
  surface_ = change.surface;
  put_contacts(change);
  if (!change.propagation) return direct_voice();
  std::swap(next_propagation_, change.propagation);
  next_propagation_->source.track = &track_;
  next_propagation_->first = sample;
  next_propagation_->push_silence(sample);
  Propagation& next = *next_propagation_;
  for (std::size_t m = 0; m < next.ears.size(); ++m) next.ears[m].begin(next.source, next.find_track(listener, m, false), sample);
  for (std::size_t m = 0; m < next.mirrored.size(); ++m) next.mirrored[m].begin(next.source, next.find_track(listener, m, true), sample);
  if (kCompiledEffects.has(Effect::kDirectivity) && next.directed) {
    DirectedSound& directed = *next.directed;
    directed.begin(track_, turned_s_, rotation_);
    for (std::size_t e = 0; e < directed.get_ear_count(); ++e)
      directed.get_receiver(e).begin(directed.make_source(e), directed.find_track(listener, e), sample);
  }
  direct_voice();
}

/// The modes sound to the ears that there are.
void SoundingBody::direct_voice() noexcept {
  if (!kCompiledEffects.has(Effect::kDirectivity) || !voice_) return;
  std::array<Directivity*, 2> weights{};
  std::size_t count = 0;
  for (const Propagation* path : {propagation_.get(), next_propagation_.get()})
    if (path != nullptr && path->directed) weights[count++] = path->directed->weights.get();
  voice_->direct(weights[0], weights[1]);
}

/// Contacts begin, change their effects, or fall.
void SoundingBody::put_contacts(BodyChange& change) noexcept {
  if (kOfContacts.is_empty()) return;
  if (change.contacts) {
    if (contacts_ && change.inherits) change.contacts->take_over(*contacts_);
    std::swap(contacts_, change.contacts);
    voice_->attach(contacts_.get());
  } else if (contacts_ && needs_contacts(effects_)) {
    contacts_->set_effects(effects_);
    if (voice_) voice_->attach(contacts_.get());  // which may be another voice of the same model
  } else if (contacts_ && change.inherits) {      // of the old model
    change.contacts = std::move(contacts_);
  } else if (contacts_) {
    contacts_->release();
    if (voice_) voice_->attach(contacts_.get());
  }
}

/// True when the delay lines of a new propagation reach back as far as its receivers read.
bool SoundingBody::is_filled(const Propagation& propagation, const ListenerTracks& listener, std::int64_t sample) const noexcept {
  if (!propagation_ || propagation_->is_silent()) return true;
  const std::int64_t filled = sample - propagation.first;
  const DelayLine& delay_line = propagation.get_line();
  const double needed =
      propagation.calc_longest_s(listener, sample) * frame_.rate_hz + propagation.ears.front().get_latency() + kTaps + kBlock;
  // The filters of a head need full lines for their whole length.
  const std::int64_t full = filled - (propagation.head.empty() ? 0 : propagation.head.front().get_length());
  return static_cast<double>(full) >= needed || full >= delay_line.get_size();
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
  direct_voice();
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
  if (propagation_) propagation_->push_silence(slept);
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

/// To all players of pulses. The continuation of a pulse is no strike of its own.
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

bool SoundingBody::take(const events::LastingContact& contact, const ContactSurface& other, std::int64_t sample,
                        ContactRecordCounters& counters) noexcept {
  if (!needs_contacts(effects_) || !contacts_) {
    ++counters.without_use;
    return false;
  }
  wake(sample);
  events::LastingContact own = contact;
  own.time_s -= static_cast<double>(first_) / frame_.rate_hz;
  const ContactCounters before = contacts_->get_counters();
  const bool is_taken = contacts_->take(own, other);
  const ContactCounters& now = contacts_->get_counters();
  work_.refused += now.refused - before.refused;
  counters.accepted += now.accepted - before.accepted;
  counters.refused += now.refused - before.refused;
  counters.dropped += now.dropped - before.dropped;
  counters.thinned += now.thinned - before.thinned;
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
  if (!kCompiledEffects.has(Effect::kDirectivity)) return true;
  for (Propagation* path : {propagation_.get(), next_propagation_.get()})
    if (path != nullptr && path->directed) path->directed->push(motion);
  return true;
}

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
    work_.deflection = std::max(work_.deflection, after.deflection);
    work_.energy_rise = std::max(work_.energy_rise, after.energy_rise);
    work_.energy.given_j += after.energy.given_j - before.energy.given_j;
    work_.energy.lost_j += after.energy.lost_j - before.energy.lost_j;
    work_.energy.radiated_j += after.energy.radiated_j - before.energy.radiated_j;
    work_.energy.held_j = after.energy.held_j;
    work_.units[Effect::kModal] += after.mode_samples - before.mode_samples;
    work_.units[Effect::kNonlinear] += after.coupled_samples - before.coupled_samples;
    work_.units[Effect::kCascade] += after.cascade_samples - before.cascade_samples;
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
    if (path == nullptr) continue;
    if (kCompiledEffects.has(Effect::kDirectivity) && path->directed) {
      if (is_idle)
        path->directed->push_silence(static_cast<std::int64_t>(mono.size()));
      else
        path->directed->push_sound(mono.size());
    }
    if (!path->monopole) continue;
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

bool SoundingBody::is_directed() const noexcept {
  const auto has_it = [](const std::unique_ptr<Propagation>& path) { return path && path->directed; };
  return has_it(propagation_) || has_it(next_propagation_);
}

int SoundingBody::find_transfer_need(std::int64_t sample) noexcept {
  int demand = 0;
  for (const Propagation* path : {propagation_.get(), next_propagation_.get()})
    if (path != nullptr && path->directed && path->directed->weights->get_block() == sample / kBlock - 1)
      demand += path->directed->weights->get_demand();
  return transfer_need_ = TransferBudget::find_need(transfer_need_, demand);
}

void SoundingBody::set_transfer_share(const TransferBudget& budget) noexcept {
  int paths = 0;
  for (const Propagation* path : {propagation_.get(), next_propagation_.get()})
    paths += static_cast<int>(path != nullptr && path->directed);
  for (const Propagation* path : {propagation_.get(), next_propagation_.get()})
    if (path != nullptr && path->directed) path->directed->weights->set_share(budget.find_share(transfer_need_) / paths);
}

/// Where the modes sound, weights for this block.
void SoundingBody::begin_directed_block(std::int64_t sample, const ListenerTracks& listener) noexcept {
  if (voice_->is_idle()) return;
  for (Propagation* path : {propagation_.get(), next_propagation_.get()}) {
    if (path == nullptr || !path->directed) continue;
    const std::int64_t before = path->directed->weights->get_evaluations();
    path->directed->begin_block(sample, track_, listener);
    work_.units[Effect::kDirectivity] += path->directed->weights->get_evaluations() - before;
  }
}

/// Modes and acceleration noise, into all delay lines.
void SoundingBody::make_sound(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch,
                              TickFunction ticks) noexcept {
  std::uint64_t started = ticks != nullptr ? ticks() : 0;
  const auto end_part = [&](Effect effect) {
    if (ticks == nullptr) return;
    const std::uint64_t now = ticks();
    work_.ticks[effect] += static_cast<std::int64_t>(now - std::exchange(started, now));
  };
  if (kCompiledEffects.has(Effect::kDirectivity) && voice_ && voice_->is_directed()) {
    begin_directed_block(sample, listener);
    end_part(Effect::kDirectivity);
  }
  if (kCompiledEffects.has(Effect::kModal) && voice_) end_part(make_modal_sound(std::span(scratch.mono).first(count)));
  if (kCompiledEffects.has(Effect::kAccelerationNoise) && acceleration_noise_) {
    std::array<std::span<float>, 3> dipole;
    for (std::size_t k = 0; k < 3; ++k) dipole[k] = std::span(scratch.dipole[k]).first(count);
    make_acceleration_noise(dipole);
    end_part(Effect::kAccelerationNoise);
  }
}

void SoundingBody::render(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch, Mix& mix,
                          TickFunction ticks) noexcept {
  wake(sample);
  make_sound(sample, count, listener, scratch, ticks);
  if (propagation_) hear(*propagation_, sample, count, listener, fading_ ? Fade::kOut : Fade::kNone, scratch, mix, ticks);
  if (next_propagation_) hear(*next_propagation_, sample, count, listener, fading_ ? Fade::kIn : Fade::kUnheard, scratch, mix, ticks);
  rendered_ = sample + static_cast<std::int64_t>(count);
}

}  // namespace carillon::synth

// Method:     modes and acceleration noise fill delay lines, which receivers read.
#include "runtime/synth/sounding_body.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "runtime/base/error.hpp"

namespace carillon::synth {
namespace {

/// True for effects of lasting contacts with modes, on which they act.
constexpr bool needs_contacts(EffectSet effects) { return effects.has(Effect::kModal) && effects.has_any(kContactEffects); }

}  // namespace

SoundingBody::SoundingBody(std::shared_ptr<const Model> model, BodyFrame frame, EffectSet effects, const Vec3& position_m,
                           const events::Quaternion& rotation)
    : model_(std::move(model)),
      frame_(std::move(frame)),
      effects_(effects),
      track_(static_cast<std::size_t>(frame_.propagation.max_waypoints)),
      rotation_(rotation) {
  check(*model_);
  track_.push({.position_m = position_m});
  surface_ = make_surface(*model_);
  modes_ = make_modes(model_);
  acceleration_noise_ = make_noise(*model_);
  contacts_ = make_contacts(model_, surface_);
  if (modes_) modes_->attach(contacts_.get());
  if (!modes_ && !acceleration_noise_) return;
  propagation_ = make_propagation(effects, frame_.propagation, model_);
  propagation_->source.track = &track_;
  if (is_directed()) modes_->direct(propagation_->directed->weights.get());
}

void SoundingBody::check(const Model& model) const {
  if (effects_.has(Effect::kDirectivity) && model.get_directivity() == nullptr)
    throw InputError("directivity: this bank has no multipoles; make the bank with them, or leave the effect out");
  if (effects_.has(Effect::kNonlinear) && model.get_nonlinear() == nullptr)
    throw InputError("nonlinear: this bank has no nonlinear energy; make the bank with it, or leave the effect out");
  if (effects_.has(Effect::kAccelerationNoise) && !(model.get_sphere_radius_m() > 0.0 && model.get_mass_kg() > 0.0))
    throw InputError("acceleration_noise: this bank has no mass or no volume; leave the effect out");
}

/// Time since the first sample of the modules.
double SoundingBody::calc_own_s(double time_s) const noexcept { return time_s - static_cast<double>(first_) / frame_.propagation.rate_hz; }

std::unique_ptr<ResonatorBank> SoundingBody::make_modes(const std::shared_ptr<const Model>& model) const {
  if (!effects_.has(Effect::kModal)) return nullptr;
  const bool is_nonlinear = effects_.has(Effect::kNonlinear);
  return std::make_unique<ResonatorBank>(
      model, ResonatorOptions{.max_strikes = frame_.max_strikes,
                              .max_forces = frame_.max_forces,
                              .silence_pa = frame_.silence_pa,
                              .isa = frame_.isa,
                              .is_nonlinear = is_nonlinear,
                              .has_cascade = is_nonlinear && effects_.has(Effect::kCascade) && model->has_cascade(),
                              .audits_energy = frame_.audits_energy});
}

std::unique_ptr<BodyAccelerationNoise> SoundingBody::make_noise(const Model& model) const {
  if (!effects_.has(Effect::kAccelerationNoise)) return nullptr;
  return std::make_unique<BodyAccelerationNoise>(
      BodyAccelerationNoise{AccelerationNoise(model.get_sphere_radius_m(), model.get_mass_kg(), frame_.propagation.rate_hz,
                                              frame_.max_strikes, frame_.max_forces),
                            Attitude(static_cast<std::size_t>(frame_.propagation.max_waypoints))});
}

std::unique_ptr<ContactForces> SoundingBody::make_contacts(const std::shared_ptr<const Model>& model, const ContactSurface& surface) const {
  if (!needs_contacts(effects_)) return nullptr;
  return std::make_unique<ContactForces>(model, ContactForcesOptions{.surface = surface, .effects = effects_});
}

ContactSurface SoundingBody::make_surface(const Model& model) const {
  return complete(frame_.surface, model.get_plane_strain_modulus_pa(), model.get_wave_impedance_pa_s_m());
}

std::unique_ptr<ModelSwap> SoundingBody::make_swap(std::shared_ptr<const Model> model) {
  auto swap = std::make_unique<ModelSwap>();
  swap->surface = make_surface(*model);
  swap->modes = make_modes(model);
  if (swap->modes) swap->handover = std::make_unique<ModeHandover>(*model_, *model);
  swap->acceleration_noise = make_noise(*model);
  swap->contacts = make_contacts(model, swap->surface);
  if (is_directed()) swap->directed = std::make_unique<DirectedSound>(effects_, frame_.propagation, model);
  model_ = std::move(model);
  return swap;
}

std::unique_ptr<BodySensors> SoundingBody::make_sensors() const {
  auto sensors = std::make_unique<BodySensors>(BodySensors::make_trace(*model_));
  sensors->set_bounds(is_directed() ? model_->get_directivity()->weight : model_->get_weights());
  return sensors;
}

void SoundingBody::sense(BodySensors& sensors, Sensor& sensor, std::int64_t sample) noexcept {
  sensors_ = &sensors;
  modes_->sense(sensors_);
  sensors.attach(sensor, *model_, frame_.silence_pa, static_cast<double>(sample) / frame_.propagation.rate_hz);
}

void SoundingBody::begin(const ListenerTracks& listener, std::int64_t sample) noexcept {
  rendered_ = first_ = sample;
  if (acceleration_noise_) acceleration_noise_->attitude.push(turned_s_, rotation_);
  if (!propagation_) return;
  propagation_->push_silence(sample);
  for (const bool is_mirrored : {false, true}) {
    std::vector<Receiver>& ears = is_mirrored ? propagation_->mirrored : propagation_->ears;
    for (std::size_t m = 0; m < ears.size(); ++m)
      ears[m].begin(propagation_->source, propagation_->find_track(listener, m, is_mirrored), sample);
  }
  if (is_directed()) begin_directed(*propagation_->directed, listener, sample);
}

void SoundingBody::begin_directed(DirectedSound& directed, const ListenerTracks& listener, std::int64_t sample) noexcept {
  directed.begin(track_, turned_s_, rotation_);
  for (std::size_t e = 0; e < directed.get_ear_count(); ++e)
    directed.get_receiver(e).begin(propagation_->make_source(directed, e), directed.find_track(listener, e), sample);
}

void SoundingBody::apply(ModelSwap& swap, const ListenerTracks& listener, std::int64_t sample) noexcept {
  wake(sample);
  swap_ = &swap;
  swap_begin_ = sample;
  surface_ = swap.surface;
  if (swap.directed) {
    begin_directed(*swap.directed, listener, sample);
    swap.directed->weights->take_over(*propagation_->directed->weights, swap.handover->from_mode);
    swap.modes->direct(swap.directed->weights.get());
    std::swap(propagation_->directed, swap.directed);
  }
  if (modes_) {
    swap.modes->take_over(*modes_, *swap.handover);
    std::swap(modes_, swap.modes);
  }
  if (acceleration_noise_) {
    swap.acceleration_noise->noise.take_over(acceleration_noise_->noise);
    std::swap(swap.acceleration_noise->attitude, acceleration_noise_->attitude);
    std::swap(acceleration_noise_, swap.acceleration_noise);
  }
  if (!contacts_) return;
  swap.contacts->take_over(*contacts_);
  std::swap(contacts_, swap.contacts);
  modes_->attach(contacts_.get());
}

ModelSwap* SoundingBody::finish_swap(std::int64_t sample) noexcept {
  if (swap_ == nullptr || (swap_->directed && sample == swap_begin_)) return nullptr;
  return std::exchange(swap_, nullptr);
}

float SoundingBody::calc_nearness(const ListenerTracks& listener, std::int64_t sample) const noexcept {
  const double time_s = static_cast<double>(sample) / frame_.propagation.rate_hz;
  const Vec3 here = track_.find(time_s).position_m;
  double nearest = std::numeric_limits<double>::infinity();  // squared
  for (std::size_t m = 0; m < frame_.propagation.microphones_m.size(); ++m) {
    const Vec3 there = listener.get_track(m).find(time_s).position_m, place = frame_.propagation.microphones_m[m];
    double square = 0.0;
    for (std::size_t k = 0; k < 3; ++k) square += (there[k] + place[k] - here[k]) * (there[k] + place[k] - here[k]);
    nearest = std::min(nearest, square);
  }
  return std::max(frame_.gain, 1e-6F) * static_cast<float>(1.0 / std::max(std::sqrt(nearest), kNearestM));
}

bool SoundingBody::is_asleep() const noexcept {
  return swap_ == nullptr && (!propagation_ || propagation_->is_silent()) && (!modes_ || modes_->is_idle()) &&
         (!acceleration_noise_ || acceleration_noise_->noise.is_idle());
}

/// Lets the modules of a body that slept catch up.
void SoundingBody::wake(std::int64_t sample) noexcept {
  const std::int64_t slept = sample - rendered_;
  if (slept <= 0) return;
  rendered_ = sample;
  if (modes_) modes_->skip(slept);
  if (acceleration_noise_) acceleration_noise_->noise.skip(slept);
  if (propagation_) propagation_->push_silence(slept);
}

bool SoundingBody::take(const events::Impulse& impulse, std::int64_t sample) noexcept {
  events::Impulse own = impulse;
  if (!effects_.has(Effect::kHertzPulse)) own.duration_s = 0.0;
  return play(own, own.duration_s > 0.0, true, sample);
}

bool SoundingBody::take(const events::Force& force, std::int64_t sample) noexcept {
  if (effects_.has(Effect::kHertzPulse)) return play(force, true, !force.continues, sample);
  return play(events::to_impulse(force), false, !force.continues, sample);
}

template <class Player, class... Attitudes>
bool hit(Player& player, const events::Impulse& impulse, const Attitudes&... attitude) noexcept {
  return player.strike(impulse, attitude...);
}
template <class Player, class... Attitudes>
bool hit(Player& player, const events::Force& force, const Attitudes&... attitude) noexcept {
  return player.push(force, attitude...);
}

/// `is_new`: false for the continuation of a pulse, which does not count as a strike.
template <class Strike>
bool SoundingBody::play(const Strike& strike, bool has_length, bool is_new, std::int64_t sample) noexcept {
  wake(sample);
  Strike own = strike;
  own.time_s = calc_own_s(strike.time_s);
  bool is_taken = false, is_refused = false;
  if (modes_) {
    const std::int64_t late = modes_->get_counters().late;
    (hit(*modes_, own) ? is_taken : is_refused) = true;
    if (is_new) work_.late += modes_->get_counters().late - late;
  }
  if (acceleration_noise_)
    (hit(acceleration_noise_->noise, own, acceleration_noise_->attitude.find(strike.time_s)) ? is_taken : is_refused) = true;
  if (is_taken) {
    work_.strikes += static_cast<std::int64_t>(is_new);
    if (has_length) ++work_.units[Effect::kHertzPulse];
  }
  if (is_refused) ++work_.refused;
  return is_taken;
}

bool SoundingBody::take(const events::LastingContact& contact, const ContactSurface& other, std::int64_t sample,
                        ContactRecordCounters& counters) noexcept {
  if (!contacts_) {
    ++counters.without_use;
    return false;
  }
  wake(sample);
  events::LastingContact own = contact;
  own.time_s = calc_own_s(contact.time_s);
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
  if (contacts_) contacts_->reach(calc_own_s(time_s));
}

/// Where the body was before a jump: on its way for a moment, then at rest.
events::BodyMotion SoundingBody::find_before(const events::BodyMotion& jump) const noexcept {
  constexpr double kOnWayS = 0.1;  // s
  events::BodyMotion before = jump;
  before.cut = false;
  before.time_s = std::nextafter(jump.time_s, -std::numeric_limits<double>::infinity());
  before.rotation = rotation_;
  const Waypoint last = track_.get_count() > 0 ? track_.get_waypoint(track_.get_count() - 1) : track_.find(before.time_s);
  const double since_s = before.time_s - last.time_s;
  const bool is_on_way = since_s >= 0.0 && since_s <= kOnWayS;
  before.velocity_m_s = is_on_way ? last.velocity_m_s : Vec3{};
  before.position_m = last.position_m;
  if (is_on_way) before.position_m = last.position_m + since_s * last.velocity_m_s;
  return before;
}

bool SoundingBody::take(const events::BodyMotion& motion) noexcept {
  if (motion.cut) {
    (void)take(find_before(motion));
    track_.cut(motion.time_s);
  }
  if (!track_.push({motion.time_s, motion.position_m, motion.velocity_m_s})) return false;
  turned_s_ = motion.time_s;
  rotation_ = motion.rotation;
  if (acceleration_noise_) acceleration_noise_->attitude.push(motion.time_s, motion.rotation);
  if (is_directed()) propagation_->directed->push(motion);
  return true;
}

/// Adds the work of a call of ResonatorBank::process() that filled `mono`.
void SoundingBody::count_modal_work(const ResonatorCounters& before, std::int64_t contact_samples, std::span<const float> mono) noexcept {
  const ResonatorCounters after = modes_->get_counters();
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
  if (contact_samples >= 0) {
    const std::int64_t textured = contacts_->get_counters().samples - contact_samples;
    if (effects_.has(Effect::kRoughness)) work_.units[Effect::kRoughness] += textured;
    if (effects_.has(Effect::kRolling)) work_.units[Effect::kRolling] += textured;
    if (effects_.has(Effect::kContactDamping)) work_.units[Effect::kContactDamping] += static_cast<std::int64_t>(mono.size());
  }
  for (const float p : mono) work_.peak_pa = std::max(work_.peak_pa, std::abs(p));
}

void SoundingBody::amplify(std::span<float> sound) const noexcept {
  if (frame_.gain == 1.0F) return;
  for (float& p : sound) p *= frame_.gain;
}

/// Sound of the modes, into their delay lines.
void SoundingBody::make_modal_sound(std::span<float> mono) noexcept {
  const auto count = static_cast<std::int64_t>(mono.size());
  if (modes_->is_idle()) {
    modes_->skip(count);
    for (DelayLine& line : propagation_->directed_lines) line.push_silence(count);
    if (propagation_->monopole) propagation_->monopole->push_silence(count);
    return;
  }
  std::fill(mono.begin(), mono.end(), 0.0F);
  const ResonatorCounters before = modes_->get_counters();
  const bool touched = contacts_ && !contacts_->is_resting();
  const std::int64_t contact_samples = touched ? contacts_->get_counters().samples : -1;
  modes_->process(mono);
  amplify(mono);
  count_modal_work(before, contact_samples, mono);
  for (std::size_t e = 0; e < propagation_->directed_lines.size(); ++e) {
    const std::span<float> sound = propagation_->directed->weights->get_sound(e).first(mono.size());
    amplify(sound);
    propagation_->directed_lines[e].push(sound);
  }
  if (propagation_->monopole) propagation_->monopole->push(mono);
}

/// Acceleration noise, into the delay lines of its three dipoles.
void SoundingBody::make_acceleration_noise(const std::array<std::span<float>, 3>& dipole) noexcept {
  AccelerationNoise& noise = acceleration_noise_->noise;
  const auto count = static_cast<std::int64_t>(dipole[0].size());
  const bool is_idle = noise.is_idle();
  if (is_idle) {
    noise.skip(count);
  } else {
    noise.process(dipole);
    for (const std::span<float>& axis : dipole) amplify(axis);
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
  for (std::size_t k = 0; k < 3; ++k) {
    if (is_idle)
      propagation_->dipole[k]->push_silence(count);
    else
      propagation_->dipole[k]->push(dipole[k]);
  }
}

int SoundingBody::find_transfer_need(std::int64_t sample) noexcept {
  const Directivity& weights = *propagation_->directed->weights;
  return transfer_need_ = TransferBudget::find_need(transfer_need_, weights.get_block() == sample / kBlock - 1 ? weights.get_demand() : 0);
}

void SoundingBody::set_transfer_share(const TransferBudget& budget) noexcept {
  propagation_->directed->weights->set_share(budget.find_share(transfer_need_));
}

/// Weights for this block, if the modes sound.
void SoundingBody::begin_directed_block(std::int64_t sample, const ListenerTracks& listener) noexcept {
  if (modes_->is_idle()) return;
  DirectedSound& directed = *propagation_->directed;
  const std::int64_t before = directed.weights->get_evaluations();
  directed.begin_block(sample, track_, listener);
  work_.units[Effect::kDirectivity] += directed.weights->get_evaluations() - before;
}

/// Modes and acceleration noise, into all delay lines.
void SoundingBody::make_sound(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch) noexcept {
  if (is_directed()) begin_directed_block(sample, listener);
  if (modes_) make_modal_sound(std::span(scratch.mono).first(count));
  if (!acceleration_noise_) return;
  std::array<std::span<float>, 3> dipole;
  for (std::size_t k = 0; k < 3; ++k) dipole[k] = std::span(scratch.dipole[k]).first(count);
  make_acceleration_noise(dipole);
}

void SoundingBody::render(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch, Mix& mix) noexcept {
  wake(sample);
  make_sound(sample, count, listener, scratch);
  if (propagation_ && !propagation_->is_silent()) hear(sample, count, listener, scratch, mix);
  rendered_ = sample + static_cast<std::int64_t>(count);
}

}  // namespace carillon::synth

// Method:     delay lines that receivers read. A floor is heard by a mirrored receiver for each. With directivity each receiver has a
//             line of its own, filled for its place (directivity.hpp), whose sound sets out from the sphere of the multipoles. A head has
//             one receiver in its middle and one for each mirrored way, each with filters of its own: what the floor reflects comes from
//             below.
// Source:     J. B. Allen et al. 1979, Image method for efficiently simulating small-room acoustics (the mirrored microphone).
// Deviations: the floor is rigid but for one factor, and has no end; the radiation of the body itself is that of free space.
#include "runtime/synth/propagation.hpp"

#include <algorithm>

#include "runtime/acoustics/head/head.hpp"
#include "runtime/acoustics/radiation/transfers.hpp"

namespace carillon::synth {
namespace {

/// The track to which an ear's offset belongs; one ear stands for all microphones where they are not `apart`.
const Trajectory& find_ear_track(const ListenerTracks& listener, bool apart, std::size_t microphone, bool is_mirrored) noexcept {
  if (kCompiledEffects.has(Effect::kGroundReflection) && is_mirrored)
    return apart ? listener.get_mirrored_track(microphone) : listener.get_mirrored_middle_track();
  return apart ? listener.get_track(microphone) : listener.get_middle_track();
}

/// Whether every microphone has an ear.
bool are_apart(EffectSet effects) noexcept { return effects.has(Effect::kTwoEars) && !has_head(effects); }

/// Samples by which receivers of these effects are later than they have to be, so that they are as late as a head.
int calc_more_latency(EffectSet effects, const PropagationOptions& options) {
  return options.head && !has_head(effects) ? options.head->head->get_latency() : 0;
}

/// What a delay line has to hold.
double calc_longest_m(EffectSet effects, const PropagationOptions& options) {
  return (effects.has(Effect::kAirDelay) ? options.longest_m : 0.0) + calc_more_latency(effects, options) / options.rate_hz * kSoundSpeedMs;
}

}  // namespace

DirectedSound::DirectedSound(const std::shared_ptr<const Model>& model, const std::vector<Vec3>& offsets_m, std::size_t straight,
                             const PropagationOptions& options, EffectSet effects)
    : weights(std::make_unique<Directivity>(model, offsets_m.size(), options.phase)),
      straight_(straight),
      apart_(are_apart(effects)),
      rate_hz_(options.rate_hz),
      offset_m_(model->get_directivity()->offset_m),
      offsets_m_(offsets_m),
      attitude_(static_cast<std::size_t>(options.max_waypoints)),
      centre_(static_cast<std::size_t>(options.max_waypoints)) {
  const double longest_m = calc_longest_m(effects, options);
  const double sphere_m = model->get_directivity()->transfers->get_radius_m();
  lines_.reserve(offsets_m.size());
  receivers_.reserve(offsets_m.size());
  for (const Vec3& offset : offsets_m) {
    lines_.emplace_back(longest_m, options.rate_hz, kBlock);
    receivers_.emplace_back(offset, options.rate_hz, effects, Isa::kBest, sphere_m, calc_more_latency(effects, options));
  }
}

void DirectedSound::begin(const Trajectory& body, double turned_s, const events::Quaternion& rotation) noexcept {
  attitude_.push(turned_s, rotation);
  last_s_ = turned_s;
  last_m_ = turn(rotation, offset_m_);
  for (std::size_t i = 0; i < body.get_count(); ++i) {
    Waypoint waypoint = body.get_waypoint(i);
    waypoint.position_m = waypoint.position_m + last_m_;
    centre_.push(waypoint);
  }
}

void DirectedSound::push(const events::BodyMotion& motion) noexcept {
  attitude_.push(motion.time_s, motion.rotation);
  const Vec3 now = turn(motion.rotation, offset_m_);
  const double since_s = motion.time_s - last_s_;
  const Vec3 speed = since_s > 0.0 ? (1.0 / since_s) * (now - last_m_) : Vec3{};
  centre_.push({motion.time_s, motion.position_m + now, motion.velocity_m_s + speed});
  last_s_ = motion.time_s;
  last_m_ = now;
}

const Trajectory& DirectedSound::find_track(const ListenerTracks& listener, std::size_t ear) const noexcept {
  return find_ear_track(listener, apart_, find_microphone(ear), is_mirrored(ear));
}

void DirectedSound::begin_block(std::int64_t sample, const Trajectory& track, const ListenerTracks& listener) noexcept {
  const std::int64_t block = sample / kBlock;
  if (weights->get_block() == block) return;
  const std::array<double, 2> time_s{static_cast<double>(block * kBlock) / rate_hz_, static_cast<double>((block + 1) * kBlock) / rate_hz_};
  BlockPoses poses;
  for (std::size_t i = 0; i < 2; ++i) {
    poses.position_m[i] = track.find(time_s[i]).position_m;
    poses.rotation[i] = attitude_.find(time_s[i]);
  }
  for (std::size_t e = 0; e < receivers_.size(); ++e) {
    const Trajectory& ear = find_track(listener, e);
    weights->set_ear(e, ear.find(time_s[0]).position_m + offsets_m_[e], ear.find(time_s[1]).position_m + offsets_m_[e]);
  }
  weights->begin_block(block, poses);
}

bool DirectedSound::is_silent() const noexcept {
  return std::all_of(lines_.begin(), lines_.end(), [](const DelayLine& line) { return line.is_silent(); });
}

void DirectedSound::push_silence(std::int64_t samples) noexcept {
  for (DelayLine& line : lines_) line.push_silence(samples);
}

void DirectedSound::push_sound(std::size_t samples) noexcept {
  for (std::size_t e = 0; e < lines_.size(); ++e) lines_[e].push(weights->get_sound(e).first(samples));
}

std::size_t DirectedSound::calc_bytes() const noexcept {
  return sizeof(DirectedSound) + weights->calc_bytes() + attitude_.get_bytes() + centre_.get_bytes() +
         offsets_m_.capacity() * sizeof(Vec3) + lines_.capacity() * sizeof(DelayLine) + receivers_.capacity() * sizeof(Receiver);
}

bool Propagation::is_silent() const noexcept {
  return has_silent_lines() && std::all_of(head.begin(), head.end(), [](const HeadEars& ears) { return ears.is_silent(); });
}

bool Propagation::has_silent_lines() const noexcept {
  if (monopole && !monopole->is_silent()) return false;
  if (kCompiledEffects.has(Effect::kDirectivity) && directed && !directed->is_silent()) return false;
  return !dipole[0] || (dipole[0]->is_silent() && dipole[1]->is_silent() && dipole[2]->is_silent());
}

void Propagation::push_silence(std::int64_t samples) noexcept {
  if (monopole) monopole->push_silence(samples);
  if (kCompiledEffects.has(Effect::kDirectivity) && directed) directed->push_silence(samples);
  for (const auto& line : dipole)
    if (line) line->push_silence(samples);
}

const Trajectory& Propagation::find_track(const ListenerTracks& listener, std::size_t ear, bool is_mirrored) const noexcept {
  return find_ear_track(listener, are_apart(effects), ear, is_mirrored);
}

double Propagation::calc_longest_s(const ListenerTracks& listener, std::int64_t sample) const noexcept {
  if (!has(effects, Effect::kAirDelay)) return 0.0;
  double longest_s = 0.0;
  for (std::size_t m = 0; m < ears.size(); ++m)
    longest_s = std::max(longest_s, ears[m].calc_delay_s(source, find_track(listener, m, false), sample));
  for (std::size_t m = 0; m < mirrored.size(); ++m)
    longest_s = std::max(longest_s, mirrored[m].calc_delay_s(source, find_track(listener, m, true), sample));
  return longest_s;
}

bool has_head(EffectSet effects) noexcept { return has(effects, Effect::kHead) && effects.has(Effect::kTwoEars); }

std::size_t count_ears(EffectSet effects, const PropagationOptions& options) noexcept {
  return (are_apart(effects) ? options.microphones_m.size() : 1) * (has(effects, Effect::kGroundReflection) ? 2 : 1);
}

std::unique_ptr<Propagation> make_propagation(EffectSet effects, const PropagationOptions& options,
                                              const std::shared_ptr<const Model>& model) {
  auto propagation = std::make_unique<Propagation>();
  propagation->effects = effects;
  const double longest_m = calc_longest_m(effects, options);
  const auto make_history = [&] { return std::make_unique<DelayLine>(longest_m, options.rate_hz, kBlock); };
  const bool is_directed = has(effects, Effect::kDirectivity) && effects.has(Effect::kModal);
  if (effects.has(Effect::kModal) && !is_directed) propagation->monopole = make_history();
  propagation->source.monopole = propagation->monopole.get();
  for (std::size_t k = 0; k < 3 && effects.has(Effect::kAccelerationNoise); ++k) {
    propagation->dipole[k] = make_history();
    propagation->source.dipole[k] = propagation->dipole[k].get();
  }
  std::vector<Vec3> offsets = are_apart(effects) ? options.microphones_m : std::vector<Vec3>{calc_middle(options.microphones_m)};
  const std::size_t straight = offsets.size();
  propagation->ears.reserve(straight);
  const auto add = [&](std::vector<Receiver>& ears, const Vec3& place) {
    ears.emplace_back(place, options.rate_hz, effects, Isa::kBest, 0.0, calc_more_latency(effects, options));
  };
  for (const Vec3& place : offsets) add(propagation->ears, place);
  if (has(effects, Effect::kGroundReflection)) {
    for (std::size_t m = 0; m < straight; ++m) offsets.push_back(options.floor->mirror_direction(offsets[m]));
    propagation->mirrored.reserve(straight);
    for (std::size_t m = straight; m < offsets.size(); ++m) add(propagation->mirrored, offsets[m]);
  }
  if (has_head(effects)) {
    propagation->head.reserve(offsets.size());
    for (std::size_t way = 0; way < offsets.size(); ++way) propagation->head.emplace_back(options.head->head);
  }
  if (is_directed) propagation->directed = std::make_unique<DirectedSound>(model, offsets, straight, options, effects);
  return propagation;
}

}  // namespace carillon::synth

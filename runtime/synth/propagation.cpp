// Method:     delay lines read by receivers. Ground reflection: a mirrored receiver for each receiver. Directivity: a delay line per
//             receiver, filled by the weights of its place (directivity.hpp); the sound leaves from the sphere of the multipoles. Head: one
//             receiver in its middle and one mirrored, each with filters of its own, since the reflection comes from below.
// Source:     J. B. Allen et al. 1979, Image method for efficiently simulating small-room acoustics (the mirrored microphone).
// Deviations: the floor is infinite and rigid except for one factor; the body radiates as in free space.
#include "runtime/synth/propagation.hpp"

#include <algorithm>

#include "runtime/acoustics/head/head.hpp"
#include "runtime/acoustics/radiation/transfers.hpp"

namespace carillon::synth {
namespace {

/// Track to which an ear's offset belongs; unless `apart`, one ear stands for all microphones.
const Trajectory& find_ear_track(const ListenerTracks& listener, bool apart, std::size_t microphone, bool is_mirrored) noexcept {
  if (is_mirrored) return apart ? listener.get_mirrored_track(microphone) : listener.get_mirrored_middle_track();
  return apart ? listener.get_track(microphone) : listener.get_middle_track();
}

/// True with one ear per microphone.
bool are_apart(EffectSet effects) noexcept { return effects.has(Effect::kTwoEars) && !has_head(effects); }

/// Number of ears without the mirrored ones.
std::size_t count_straight(EffectSet effects, const PropagationOptions& options) {
  return are_apart(effects) ? options.microphones_m.size() : 1;
}

/// Additional latency [samples] of receivers without a head, equal to that of the head.
int calc_more_latency(EffectSet effects, const PropagationOptions& options) {
  return options.head && !has_head(effects) ? options.head->get_latency() : 0;
}

/// Length of a delay line.
double calc_longest_m(EffectSet effects, const PropagationOptions& options) {
  return (effects.has(Effect::kAirDelay) ? options.longest_m : 0.0) + calc_more_latency(effects, options) / options.rate_hz * kSoundSpeedMs;
}

/// Offsets of the ears from their tracks, the mirrored ones last.
std::vector<Vec3> list_offsets(EffectSet effects, const PropagationOptions& options) {
  std::vector<Vec3> offsets = are_apart(effects) ? options.microphones_m : std::vector<Vec3>{calc_middle(options.microphones_m)};
  const std::size_t straight = offsets.size();
  for (std::size_t m = 0; m < straight && effects.has(Effect::kGroundReflection); ++m)
    offsets.push_back(options.floor->mirror_direction(offsets[m]));
  return offsets;
}

}  // namespace

DirectedSound::DirectedSound(EffectSet effects, const PropagationOptions& options, const std::shared_ptr<const Model>& model)
    : weights(std::make_unique<Directivity>(model, list_offsets(effects, options).size(), options.phase)),
      straight_(count_straight(effects, options)),
      apart_(are_apart(effects)),
      rate_hz_(options.rate_hz),
      offset_m_(model->get_directivity()->offset_m),
      offsets_m_(list_offsets(effects, options)),
      attitude_(static_cast<std::size_t>(options.max_waypoints)),
      centre_(static_cast<std::size_t>(options.max_waypoints)) {
  const double sphere_m = model->get_directivity()->transfers->get_radius_m();
  receivers_.reserve(offsets_m_.size());
  for (const Vec3& offset : offsets_m_)
    receivers_.emplace_back(offset, options.rate_hz, effects, Isa::kBest, sphere_m, calc_more_latency(effects, options));
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
  const Vec3 speed = since_s > 0.0 && !motion.cut ? (1.0 / since_s) * (now - last_m_) : Vec3{};
  centre_.push({motion.time_s, motion.position_m + now, motion.velocity_m_s + speed});
  if (motion.cut) centre_.cut(motion.time_s);
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

bool Propagation::is_silent() const noexcept {
  const auto is_quiet = [](const auto& part) { return part.is_silent(); };
  if (monopole && !monopole->is_silent()) return false;
  if (dipole[0] && !(dipole[0]->is_silent() && dipole[1]->is_silent() && dipole[2]->is_silent())) return false;
  return std::all_of(directed_lines.begin(), directed_lines.end(), is_quiet) && std::all_of(head.begin(), head.end(), is_quiet);
}

void Propagation::push_silence(std::int64_t samples) noexcept {
  if (monopole) monopole->push_silence(samples);
  for (DelayLine& line : directed_lines) line.push_silence(samples);
  for (const auto& line : dipole)
    if (line) line->push_silence(samples);
}

const Trajectory& Propagation::find_track(const ListenerTracks& listener, std::size_t ear, bool is_mirrored) const noexcept {
  return find_ear_track(listener, are_apart(effects), ear, is_mirrored);
}

bool has_head(EffectSet effects) noexcept { return effects.has(Effect::kHead) && effects.has(Effect::kTwoEars); }

std::unique_ptr<Propagation> make_propagation(EffectSet effects, const PropagationOptions& options,
                                              const std::shared_ptr<const Model>& model) {
  auto propagation = std::make_unique<Propagation>();
  propagation->effects = effects;
  const double longest_m = calc_longest_m(effects, options);
  const auto make_line = [&] { return std::make_unique<DelayLine>(longest_m, options.rate_hz, kBlock); };
  const std::vector<Vec3> offsets = list_offsets(effects, options);
  if (effects.has(Effect::kModal) && effects.has(Effect::kDirectivity)) {
    propagation->directed = std::make_unique<DirectedSound>(effects, options, model);
    for (std::size_t e = 0; e < offsets.size(); ++e) propagation->directed_lines.emplace_back(longest_m, options.rate_hz, kBlock);
  } else if (effects.has(Effect::kModal)) {
    propagation->monopole = make_line();
  }
  propagation->source.monopole = propagation->monopole.get();
  for (std::size_t k = 0; k < 3 && effects.has(Effect::kAccelerationNoise); ++k) {
    propagation->dipole[k] = make_line();
    propagation->source.dipole[k] = propagation->dipole[k].get();
  }
  const std::size_t straight = count_straight(effects, options);
  for (std::size_t e = 0; e < offsets.size(); ++e)
    (e < straight ? propagation->ears : propagation->mirrored)
        .emplace_back(offsets[e], options.rate_hz, effects, Isa::kBest, 0.0, calc_more_latency(effects, options));
  for (std::size_t e = 0; e < offsets.size() && has_head(effects); ++e) {
    if (options.head->ambisonic_order > 0)
      propagation->ambisonics.emplace_back(options.head->ambisonic_order);
    else
      propagation->head.emplace_back(options.head->head);
  }
  return propagation;
}

}  // namespace carillon::synth

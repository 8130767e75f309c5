// Sound of one body at the ears: microphones, mirrored ears and heads.
#include <algorithm>
#include <array>
#include <span>

#include "runtime/synth/smooth_step.hpp"
#include "runtime/synth/sounding_body.hpp"

namespace carillon::synth {
namespace {

/// Smooth step from 0 to 1 over a block, or back.
double calc_fade(Fade fade, std::int64_t sample) noexcept {
  const double in = calc_smooth_step(static_cast<double>(sample % kBlock) / kBlock);
  return fade == Fade::kIn ? in : 1.0 - in;
}

void apply_fade(Fade fade, std::int64_t sample, std::span<double> sound) noexcept {
  for (std::size_t n = 0; n < sound.size() && fade != Fade::kNone; ++n) sound[n] *= calc_fade(fade, sample + static_cast<std::int64_t>(n));
}

}  // namespace

/// Adds the sound at one ear, times a level, to the mix of its microphone, or to all mixes without two ears. Returns the number of samples
/// with a changing travel time.
int SoundingBody::hear_ear(Receiver& ear, const Source& source, const Trajectory& track, std::size_t microphone, double level,
                           std::int64_t sample, std::size_t count, Fade fade, BodyScratch& scratch, Mix& mix) noexcept {
  const bool apart = effects_.has(Effect::kTwoEars);
  if (apart && fade == Fade::kNone && level == 1.0) return ear.process(source, track, sample, std::span(mix[microphone]).first(count));
  const std::span<double> heard = std::span(scratch.heard).first(count);
  std::fill(heard.begin(), heard.end(), 0.0);
  const int moved = ear.process(source, track, sample, heard);
  apply_fade(fade, sample, heard);
  if (level != 1.0)
    for (double& p : heard) p *= level;
  for (std::size_t c = apart ? microphone : 0; c < (apart ? microphone + 1 : mix.size()); ++c)
    for (std::size_t n = 0; n < count; ++n) mix[c][n] += heard[n];
  return moved;
}

/// Counts the work of an ear.
void SoundingBody::count_ear(std::size_t microphone, bool is_mirrored, int moved, std::size_t count) noexcept {
  if (is_mirrored) {
    work_.units[Effect::kGroundReflection] += static_cast<std::int64_t>(count);
    return;
  }
  if (effects_.has(Effect::kAirDelay)) work_.units[Effect::kAirDelay] += static_cast<std::int64_t>(count);
  if (effects_.has(Effect::kDoppler)) work_.units[Effect::kDoppler] += moved;
  if (microphone > 0) work_.units[Effect::kTwoEars] += static_cast<std::int64_t>(count);
}

void SoundingBody::hear(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch, Mix& mix) noexcept {
  Propagation& propagation = *propagation_;
  if (has_head(effects_)) return hear_by_head(sample, count, listener, scratch, mix);
  for (std::size_t m = 0; m < propagation.ears.size() && (propagation.monopole || propagation.dipole[0]); ++m) {
    for (const bool is_mirrored : {false, true}) {
      if (is_mirrored && propagation.mirrored.empty()) continue;
      Receiver& ear = is_mirrored ? propagation.mirrored[m] : propagation.ears[m];
      const double level = is_mirrored ? listener.get_floor()->reflection : 1.0;
      const Trajectory& track = propagation.find_track(listener, m, is_mirrored);
      count_ear(m, is_mirrored, hear_ear(ear, propagation.source, track, m, level, sample, count, Fade::kNone, scratch, mix), count);
    }
  }
  if (!propagation.directed) return;
  const bool fades = swap_ != nullptr;
  if (fades) hear_directed(*swap_->directed, sample, count, listener, Fade::kOut, scratch, mix);
  hear_directed(*propagation.directed, sample, count, listener, fades ? Fade::kIn : Fade::kNone, scratch, mix);
}

void SoundingBody::hear_directed(DirectedSound& directed, std::int64_t sample, std::size_t count, const ListenerTracks& listener, Fade fade,
                                 BodyScratch& scratch, Mix& mix) noexcept {
  for (std::size_t e = 0; e < directed.get_ear_count(); ++e) {
    const std::size_t m = directed.find_microphone(e);
    const bool is_mirrored = directed.is_mirrored(e);
    const double level = is_mirrored ? listener.get_floor()->reflection : 1.0;
    const int moved = hear_ear(directed.get_receiver(e), propagation_->make_source(directed, e), directed.find_track(listener, e), m, level,
                               sample, count, fade, scratch, mix);
    if (fade != Fade::kOut) count_ear(m, is_mirrored, moved, count);
  }
}

/// The straight sound in the middle of the head, then that by way of the floor, each through the head's ears from its own direction. All
/// sound of a body has one direction: that of its centre of mass, or of its multipoles if they are its only source.
void SoundingBody::hear_by_head(std::int64_t sample, std::size_t count, const ListenerTracks& listener, BodyScratch& scratch,
                                Mix& mix) noexcept {
  Propagation& propagation = *propagation_;
  const bool has_whole = propagation.monopole || propagation.dipole[0];
  for (std::size_t way = 0; way < propagation.head.size() + propagation.ambisonics.size(); ++way) {
    const bool is_mirrored = way > 0;
    const double level = is_mirrored ? listener.get_floor()->reflection : 1.0;
    const std::span<double> arrived = std::span(scratch.heard).first(count);
    std::fill(arrived.begin(), arrived.end(), 0.0);
    std::array<Vec3, kSubBlocks> direction{};  // from the body, at the end of each sub-block
    int moved = 0;
    const auto hear_one = [&](Receiver& ear, const Source& source, const Trajectory& track, bool is_first, Fade fade) {
      for (std::size_t n = 0; n < count; n += kSubBlock) {
        const std::span<double> piece = arrived.subspan(n, std::min<std::size_t>(kSubBlock, count - n));
        const std::int64_t at = sample + static_cast<std::int64_t>(n);
        std::array<double, kSubBlock> faded{};
        const int changed = ear.process(source, track, at, fade == Fade::kNone ? piece : std::span(faded).first(piece.size()));
        apply_fade(fade, at, faded);
        for (std::size_t i = 0; i < piece.size() && fade != Fade::kNone; ++i) piece[i] += faded[i];
        if (!is_first) continue;
        moved += changed;
        direction[n / kSubBlock] = ear.get_direction();
      }
    };
    if (has_whole)
      hear_one(is_mirrored ? propagation.mirrored[0] : propagation.ears[0], propagation.source,
               propagation.find_track(listener, 0, is_mirrored), true, Fade::kNone);
    for (DirectedSound* directed : {swap_ != nullptr ? swap_->directed.get() : nullptr, propagation.directed.get()}) {
      if (directed == nullptr) continue;
      const bool is_new = directed == propagation.directed.get();
      hear_one(directed->get_receiver(way), propagation.make_source(*directed, way), directed->find_track(listener, way),
               is_new && !has_whole,
               swap_ == nullptr ? Fade::kNone
               : is_new         ? Fade::kIn
                                : Fade::kOut);
    }
    count_ear(0, is_mirrored, moved, count);
    if (level != 1.0)
      for (double& p : arrived) p *= level;

    for (std::size_t n = 0; n < count; n += kSubBlock) {
      const std::size_t size = std::min<std::size_t>(kSubBlock, count - n);
      Vec3 from = -1.0 * direction[n / kSubBlock];
      if (is_mirrored) from = listener.get_floor()->mirror_direction(from);
      const double end_s =
          static_cast<double>(sample + static_cast<std::int64_t>(n + size) - Receiver::kLatency) / frame_.propagation.rate_hz;
      const Vec3 in_head = listener.find_in_head(from, end_s);
      if (!propagation.ambisonics.empty())
        propagation.ambisonics[way].process(in_head, arrived.subspan(n, size), mix, n);
      else
        propagation.head[way].process(in_head, arrived.subspan(n, size), std::span(mix[0]).subspan(n, size),
                                      std::span(mix[1]).subspan(n, size));
    }
    work_.units[Effect::kHead] += static_cast<std::int64_t>(count);
  }
}

}  // namespace carillon::synth

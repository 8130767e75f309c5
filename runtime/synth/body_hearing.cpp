// The sound of one body at the ears: microphones, mirrored ears and heads.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "runtime/synth/sounding_body.hpp"

namespace carillon::synth {
namespace {

/// From 0 to 1 over a block, or back.
double calc_fade(Fade fade, std::int64_t sample) noexcept {
  if (fade == Fade::kNone) return 1.0;
  if (fade == Fade::kUnheard) return 0.0;
  const double u = static_cast<double>(sample % kBlock) / kBlock, in = u * u * (3.0 - 2.0 * u);
  return fade == Fade::kIn ? in : 1.0 - in;
}

}  // namespace

/// Adds the sound at one ear, times a level, to the mix of its microphone, or to all mixes unless `apart`. Returns the number of samples
/// with a changing travel time.
int SoundingBody::hear_ear(Receiver& ear, const Source& source, const Trajectory& track, std::size_t microphone, double level,
                           std::int64_t sample, std::size_t count, Fade fade, bool apart, BodyScratch& scratch, Mix& mix) noexcept {
  if (apart && fade == Fade::kNone && level == 1.0) return ear.process(source, track, sample, std::span(mix[microphone]).first(count));
  const std::span<double> heard = std::span(scratch.heard).first(count);
  std::fill(heard.begin(), heard.end(), 0.0);
  const int moved = ear.process(source, track, sample, heard);
  for (std::size_t n = 0; n < count && fade != Fade::kNone; ++n) heard[n] *= calc_fade(fade, sample + static_cast<std::int64_t>(n));
  if (level != 1.0)
    for (double& p : heard) p *= level;
  for (std::size_t c = apart ? microphone : 0; c < (apart ? microphone + 1 : mix.size()); ++c)
    for (std::size_t n = 0; n < count; ++n) mix[c][n] += heard[n];
  return moved;
}

/// Counts the work and the time of an ear.
void SoundingBody::count_ear(const Propagation& propagation, Effect sends, std::size_t microphone, bool is_mirrored, int moved,
                             std::size_t count, std::int64_t ticks) noexcept {
  const bool has_delay = has(propagation.effects, Effect::kAirDelay);
  if (is_mirrored) {
    work_.units[Effect::kGroundReflection] += static_cast<std::int64_t>(count);
  } else {
    if (has_delay) work_.units[Effect::kAirDelay] += static_cast<std::int64_t>(count);
    if (has(propagation.effects, Effect::kDoppler)) work_.units[Effect::kDoppler] += moved;
    if (microphone > 0) work_.units[Effect::kTwoEars] += static_cast<std::int64_t>(count);
  }
  const Effect carries = moved > 0 ? Effect::kDoppler : has_delay ? Effect::kAirDelay : sends;
  work_.ticks[is_mirrored ? Effect::kGroundReflection : microphone > 0 ? Effect::kTwoEars : carries] += ticks;
}

void SoundingBody::hear(Propagation& propagation, std::int64_t sample, std::size_t count, const ListenerTracks& listener, Fade fade,
                        BodyScratch& scratch, Mix& mix, TickFunction ticks) noexcept {
  if (propagation.is_silent()) return;
  if (kCompiledEffects.has(Effect::kHead) && !propagation.head.empty())
    return hear_by_head(propagation, sample, count, listener, fade, scratch, mix, ticks);
  if (fade == Fade::kUnheard) return;
  std::uint64_t started = ticks != nullptr ? ticks() : 0;
  const bool apart = has(propagation.effects, Effect::kTwoEars);
  const auto add_work = [&](Effect sends, std::size_t m, bool is_mirrored, int moved) {
    const std::uint64_t now = ticks != nullptr ? ticks() : 0;
    count_ear(propagation, sends, m, is_mirrored, moved, count, static_cast<std::int64_t>(now - std::exchange(started, now)));
  };
  const Effect sends = propagation.monopole ? Effect::kModal : Effect::kAccelerationNoise;
  for (std::size_t m = 0; m < propagation.ears.size() && (propagation.monopole || propagation.dipole[0]); ++m) {
    const Trajectory& track = propagation.find_track(listener, m, false);
    add_work(sends, m, false, hear_ear(propagation.ears[m], propagation.source, track, m, 1.0, sample, count, fade, apart, scratch, mix));
    if (!kCompiledEffects.has(Effect::kGroundReflection) || propagation.mirrored.empty()) continue;
    const Trajectory& mirrored = propagation.find_track(listener, m, true);
    add_work(sends, m, true,
             hear_ear(propagation.mirrored[m], propagation.source, mirrored, m, listener.get_floor()->reflection, sample, count, fade,
                      apart, scratch, mix));
  }
  if (!kCompiledEffects.has(Effect::kDirectivity) || !propagation.directed) return;
  DirectedSound& directed = *propagation.directed;
  for (std::size_t e = 0; e < directed.get_ear_count(); ++e) {
    const std::size_t m = directed.find_microphone(e);
    const bool is_mirrored = directed.is_mirrored(e);
    const double level = is_mirrored ? listener.get_floor()->reflection : 1.0;
    add_work(Effect::kDirectivity, m, is_mirrored,
             hear_ear(directed.get_receiver(e), directed.make_source(e), directed.find_track(listener, e), m, level, sample, count, fade,
                      apart, scratch, mix));
  }
}

/// The straight sound in the middle of the head, then that by way of the floor, each through the head's ears from its own direction. All
/// sound of a body has one direction: that of its centre of mass, or of its multipoles where they are its only source.
void SoundingBody::hear_by_head(Propagation& propagation, std::int64_t sample, std::size_t count, const ListenerTracks& listener, Fade fade,
                                BodyScratch& scratch, Mix& mix, TickFunction ticks) noexcept {
  const bool has_whole = propagation.monopole || propagation.dipole[0];
  const Effect sends = propagation.monopole ? Effect::kModal : has_whole ? Effect::kAccelerationNoise : Effect::kDirectivity;
  for (std::size_t way = 0; way < propagation.head.size(); ++way) {
    const bool is_mirrored = way > 0;
    const double level = is_mirrored ? listener.get_floor()->reflection : 1.0;
    std::uint64_t started = ticks != nullptr ? ticks() : 0;
    const std::span<double> arrived = std::span(scratch.heard).first(count);
    std::fill(arrived.begin(), arrived.end(), 0.0);
    std::array<Vec3, kSubBlocks> direction{};  // from the body, at the end of each sub-block
    int moved = 0;
    const auto hear_one = [&](Receiver& ear, const Source& source, const Trajectory& track, bool is_first) {
      for (std::size_t n = 0; n < count; n += kSubBlock) {
        const std::span<double> piece = arrived.subspan(n, std::min<std::size_t>(kSubBlock, count - n));
        const int changed = ear.process(source, track, sample + static_cast<std::int64_t>(n), piece);
        if (!is_first) continue;
        moved += changed;
        direction[n / kSubBlock] = ear.get_direction();
      }
    };
    if (has_whole)
      hear_one(is_mirrored ? propagation.mirrored[0] : propagation.ears[0], propagation.source,
               propagation.find_track(listener, 0, is_mirrored), true);
    if (kCompiledEffects.has(Effect::kDirectivity) && propagation.directed) {
      DirectedSound& directed = *propagation.directed;
      hear_one(directed.get_receiver(way), directed.make_source(way), directed.find_track(listener, way), !has_whole);
    }
    std::uint64_t now = ticks != nullptr ? ticks() : 0;
    count_ear(propagation, sends, 0, is_mirrored, moved, count, static_cast<std::int64_t>(now - std::exchange(started, now)));
    if (level != 1.0)
      for (double& p : arrived) p *= level;

    std::array<std::span<double>, 2> ears{std::span(mix[0]).first(count), std::span(mix[1]).first(count)};
    if (fade != Fade::kNone) {
      for (std::size_t e = 0; e < 2; ++e) {
        ears[e] = std::span(scratch.by_head[e]).first(count);
        std::fill(ears[e].begin(), ears[e].end(), 0.0);
      }
    }
    for (std::size_t n = 0; n < count; n += kSubBlock) {
      const std::size_t size = std::min<std::size_t>(kSubBlock, count - n);
      Vec3 from = -1.0 * direction[n / kSubBlock];
      if (is_mirrored) from = listener.get_floor()->mirror_direction(from);
      const double end_s = static_cast<double>(sample + static_cast<std::int64_t>(n + size) - Receiver::kLatency) / frame_.rate_hz;
      propagation.head[way].process(listener.find_in_head(from, end_s), arrived.subspan(n, size), ears[0].subspan(n, size),
                                    ears[1].subspan(n, size));
    }
    if (fade == Fade::kIn || fade == Fade::kOut) {
      for (std::size_t n = 0; n < count; ++n) {
        const double share = calc_fade(fade, sample + static_cast<std::int64_t>(n));
        for (std::size_t e = 0; e < 2; ++e) mix[e][n] += share * ears[e][n];
      }
    }
    work_.units[Effect::kHead] += static_cast<std::int64_t>(count);
    now = ticks != nullptr ? ticks() : 0;
    work_.ticks[Effect::kHead] += static_cast<std::int64_t>(now - started);
  }
}

}  // namespace carillon::synth

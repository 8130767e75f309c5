// Reasons of the choice of effects as sentences.
#include <fmt/format.h>

#include <cmath>

#include "runtime/scene/effects/effect_selector.hpp"

namespace carillon::effects {
namespace {

/// "34.2 dB(A)", or "no sound".
std::string format_level(double level_db) { return std::isfinite(level_db) ? fmt::format("{:.1f} dB(A)", level_db) : "no sound"; }

}  // namespace

std::string describe(const SelectionReason& r) {
  using Rule = SelectionReason::Rule;
  switch (r.rule) {
    case Rule::kForced:
      return "set by the scene";
    case Rule::kNotOffered:
      return "not in the scene's list";
    case Rule::kNeedsOther:
      return fmt::format("has no effect without {}", synth::get_name(r.other));
    case Rule::kNotStruck:
      return "no event for this body";
    case Rule::kNoModes:
      return "no mode between 20 Hz and half the sample rate";
    case Rule::kTooQuiet:
      if (!std::isfinite(r.value) || !std::isfinite(r.limit)) return "makes no sound";
      return fmt::format("{}, inaudible below {}", format_level(r.value), format_level(r.limit));
    case Rule::kHeard:
      return fmt::format("audible, {} at {:.2f} m", format_level(r.value), r.distance_m);
    case Rule::kChange:
      if (!std::isfinite(r.value)) return "no difference without it";
      return fmt::format("difference without it: {:.1f} dB, {} than {:.0f} dB", r.value, r.value > r.limit ? "more" : "less", r.limit);
    case Rule::kThump:
      if (!std::isfinite(r.value)) return "no thump (large body)";
      return fmt::format("thump of {:.1f} dB (large body), audible above {:.1f} dB", r.value, r.limit);
    case Rule::kFixed:
      return "the body is fixed";
    case Rule::kOneMicrophone:
      return "one microphone";
    case Rule::kStill:
      return r.limit > 0.0 ? fmt::format("distance to the microphones changes by {:.3f} mm while it sounds, less than {:.3f} mm",
                                         1e3 * r.value, 1e3 * r.limit)
                           : "body and listener are at rest";
    case Rule::kMoving:
      return fmt::format("distance to a microphone changes while it sounds, by more than {:.3f} mm", 1e3 * r.limit);
    case Rule::kSameWay:
      return fmt::format("distances to the microphones differ from the distance to their middle by {:.3f} mm, less than {:.3f} mm",
                         1e3 * r.value, 1e3 * r.limit);
    case Rule::kOtherWay:
      return fmt::format("distances to the microphones differ from the distance to their middle by {:.1f} mm, more than {:.3f} mm",
                         1e3 * r.value, 1e3 * r.limit);
    case Rule::kNoContact:
      return "no lasting contact";
    case Rule::kNoSlip:
      return fmt::format("{:.2g} mm/s at most, less than {:g} mm/s", 1e3 * r.value, 1e3 * r.limit);
    case Rule::kSlip:
      return fmt::format("{:.3g} m/s, more than {:g} mm/s", r.value, 1e3 * r.limit);
    case Rule::kAirTravel:
      return fmt::format("{:.2f} m to the nearest microphone, {:.2f} ms", r.value, 1e3 * r.value / bank::kSoundSpeedMs);
    case Rule::kNoMultipoles:
      return "the bank has no multipoles";
    case Rule::kSameAllRound:
    case Rule::kDirected:
      return fmt::format("level varies over directions by {:.1f} dB, {} than {:.0f} dB", r.value, r.value > r.limit ? "more" : "less",
                         r.limit);
    case Rule::kFaint:
      return fmt::format("{} at {:.2f} m, directions inaudible below {}", format_level(r.value), r.distance_m, format_level(r.limit));
    case Rule::kNoFloor:
      return "no reflecting ground";
    case Rule::kReflected:
      return fmt::format("reflection of {:.1f} dB relative to the direct sound, {} than {:.0f} dB", r.value,
                         r.value > r.limit ? "more" : "less", r.limit);
    case Rule::kNoHead:
      return "the listener has no head";
    case Rule::kByHead:
      return "the listener has a head or Ambisonics";
    case Rule::kNoEnergy:
      return "the bank has no nonlinear energy";
    case Rule::kNothingAbove:
      return "the bank has no modes above the coupled ones, or no thickness";
    case Rule::kHardens:
      return fmt::format("a strike raises a mode by {:.3g} cents, {} than {:g}", r.value, r.value > r.limit ? "more" : "less", r.limit);
  }
  return "";
}

}  // namespace carillon::effects

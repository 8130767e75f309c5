// A hard floor: a plane that throws sound back.
#pragma once

#include "runtime/base/vector.hpp"

namespace carillon::synth {

/// A rigid plane without an end. What a source sends to a microphone by way of it is what it would send to the mirrored microphone
/// straight on, times `reflection`: exact for a rigid plane and any source that is itself not changed by it, as bodies are that stand off
/// by half a wave or more.
struct Floor {
  Vec3 point_m{};              // of the plane
  Vec3 normal{0.0, 0.0, 1.0};  // unit, to the side where bodies and microphones are
  double reflection = 1.0;     // 0..1, of the pressure

  /// Of a direction or a speed.
  Vec3 mirror_direction(const Vec3& x) const noexcept { return x - (2.0 * dot(x, normal)) * normal; }
  Vec3 mirror(const Vec3& x_m) const noexcept { return point_m + mirror_direction(x_m - point_m); }
  double calc_height_m(const Vec3& x_m) const noexcept { return dot(x_m - point_m, normal); }
};

/// What is wrong with a floor, as part of a sentence; nullptr: nothing.
inline const char* find_fault(const Floor& floor) noexcept {
  const double square = dot(floor.normal, floor.normal), place = dot(floor.point_m, floor.point_m);
  if (!(place < 1e300)) return "it must be at a finite place";
  if (!(square > 1.0 - 1e-9 && square < 1.0 + 1e-9)) return "its normal must be a unit vector";
  if (!(floor.reflection >= 0.0 && floor.reflection <= 1.0)) return "its reflection must be between 0 and 1";
  return nullptr;
}

}  // namespace carillon::synth

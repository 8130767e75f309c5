// Reflecting floor.
#pragma once

#include "runtime/base/vector.hpp"

namespace carillon::synth {

/// Infinite rigid plane: the reflected sound of a source at a microphone is that at the mirrored microphone, times `reflection`. Exact for
/// a rigid plane and sources that it does not load, such as bodies at least half a wavelength away.
struct Floor {
  Vec3 point_m{};              // on the plane
  Vec3 normal{0.0, 0.0, 1.0};  // unit, towards bodies and microphones
  double reflection = 1.0;     // pressure factor, 0..1

  /// Mirrors a direction or a velocity.
  Vec3 mirror_direction(const Vec3& x) const noexcept { return x - (2.0 * dot(x, normal)) * normal; }
  Vec3 mirror(const Vec3& x_m) const noexcept { return point_m + mirror_direction(x_m - point_m); }
  double calc_height_m(const Vec3& x_m) const noexcept { return dot(x_m - point_m, normal); }
};

/// Fault of a floor as part of a sentence; nullptr: none.
inline const char* find_fault(const Floor& floor) noexcept {
  const double square = dot(floor.normal, floor.normal), place = dot(floor.point_m, floor.point_m);
  if (!(place < 1e300)) return "its position must be finite";
  if (!(square > 1.0 - 1e-9 && square < 1.0 + 1e-9)) return "its normal must be a unit vector";
  if (!(floor.reflection >= 0.0 && floor.reflection <= 1.0)) return "its reflection must be between 0 and 1";
  return nullptr;
}

}  // namespace carillon::synth

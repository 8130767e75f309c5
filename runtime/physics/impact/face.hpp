// Flat faces that land: the springs of their corners.
#pragma once

#include <span>

#include "runtime/base/vector.hpp"
#include "runtime/physics/impact/impact.hpp"

namespace carillon::impact {

/// The contact of an impact as a corner of a flat face.
struct FaceCorner {
  bool is_sharp = false;  // false: of a curved surface, its spring is its own
  Vec3 where_m{}, normal{};
  double size_m = 0.0, compliance_per_pa = 0.0;  // of the two bodies
};

/// Springs of an impact, of which `springs` has those of open contacts as single points: three corners of a face or more share its
/// stiffness once each is pressed deeper than `flat_m`, the flatness of faces, within `ahead_s`. Lengths: one per contact of the impact.
void share_faces(const Impact& impact, std::span<const FaceCorner> corners, double flat_m, double ahead_s, std::span<Spring> springs);

}  // namespace carillon::impact

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
  double size_m = 0.0, compliance_per_pa = 0.0;  // of the smaller body; of both, 1/E*
};

/// In and out: `springs`, one per contact as `corners`; of open contacts that of a single point, of compressed ones the present spring.
/// Three corners of a face or more get equal shares of its stiffness once each is pressed deeper than `flat_m` [m] within `ahead_s` [s].
void share_faces(const Impact& impact, std::span<const FaceCorner> corners, double flat_m, double ahead_s, std::span<Spring> springs);

}  // namespace carillon::impact

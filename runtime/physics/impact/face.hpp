// Flat faces that land: the springs of their corners.
#pragma once

#include <span>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/impact/impact.hpp"

namespace carillon::impact {

inline constexpr double kFlatnessRatio = 0.02;  // fraction of the size: maximum distance of corners from the plane of their face

/// The contact of an impact as a corner of a flat face.
struct FaceCorner {
  Spring alone;           // of this point alone
  bool is_sharp = false;  // false: of a curved surface, which belongs to no face
  Vec3 where_m{}, normal{};
  double size_m = 0.0, compliance_per_pa = 0.0;  // of the smaller body; of both, 1/E*
};

/// Springs of an impact, one per contact as `corners`. Three corners of a face or more get equal shares of its stiffness once each is
/// pressed deeper than `flat_m` [m] within `ahead_s` [s]; other contacts keep their springs while compressed, open ones get those of points
/// alone.
std::vector<Spring> find_springs(const Impact& impact, std::span<const FaceCorner> corners, double flat_m, double ahead_s);

}  // namespace carillon::impact

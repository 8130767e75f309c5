// Corners of flat faces that land together. Internal to this folder.
#pragma once

#include <array>
#include <vector>

#include "runtime/drive/touch_bodies.hpp"
#include "runtime/drive/touch_spots.hpp"

namespace carillon::drive {

/// A corner of one body over a surface of the other.
struct Corner {
  std::array<Vec3, 2> stations_m{};  // on a and b, mesh frames; of the ground in the world
  double approach_m_s = 0.0;         // > 0: closing
  double gap_m = 0.0;                // when the first corner touches
};

/// Closing speed of the two bodies of a hit at other stations, in the motion before it [m/s].
double calc_approach_before(const StepView& step, const FinishedHit& hit, const std::array<Vec3, 2>& stations_m);

/// Corners that close, and touch within `within_s` of the first of them, in the motion before a hit. Ground and fixed bodies without a bank
/// are planes; none on moving bodies without a bank, nor on bodies with too many corners (SharpEdges).
std::vector<Corner> find_corners(const StepView& step, const FinishedHit& hit, double within_s);

}  // namespace carillon::drive

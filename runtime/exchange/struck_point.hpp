// A point of the surface that is struck, or where motion is read.
#pragma once

#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::exchange {

struct StruckPoint {
  Vec3 point_m{}, inward{};   // mesh axes; unit normal, zero where the triangle has no area
  std::vector<Vec3> shape{};  // (m) mass-normalised [kg^-1/2]

  /// (m) Modal velocity after a blow of 1 N s along `inward` [m kg^1/2 / s].
  std::vector<double> calc_velocities() const;
};

/// Nearest point of the surface. Throws InputError for a place that is far from it.
StruckPoint find_struck_point(const bank::Bank& bank, const Vec3& point_m);

}  // namespace carillon::exchange

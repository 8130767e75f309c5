// Paths of driven nodes: rows of time and position, smoothly interpolated. Std only.
#pragma once

#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::transient {

/// Displacement [m] at a time.
struct PathRow {
  double time_s = 0.0;
  Vec3 displacement_m{};
};

/// Displacement through the rows, with continuous velocity and acceleration: at rest before the first and after the last row. Quintic
/// Hermite pieces; at inner rows velocity and acceleration are those of the parabola through the row and its neighbours. Two rows give the
/// minimum-jerk movement (Flash and Hogan 1985).
class Path {
 public:
  Path() = default;  // no displacement at any time
  /// Throws InputError: times not ascending, first displacement other than 0, non-finite values.
  explicit Path(std::vector<PathRow> rows);

  Vec3 calc(double time_s) const;

 private:
  std::vector<PathRow> rows_;
  std::vector<Vec3> slope_m_s_, bend_m_s2_;  // (rows)
};

}  // namespace carillon::transient

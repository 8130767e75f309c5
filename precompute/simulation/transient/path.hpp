// Where driven nodes are: rows of time and place, joined smoothly. Std only.
#pragma once

#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::transient {

/// Displacement [m] at a time.
struct PathRow {
  double time_s = 0.0;
  Vec3 displacement_m{};
};

/// A displacement that passes through the rows, with continuous velocity and acceleration everywhere: it rests before the first row and
/// behind the last one. Between rows a quintic (Hermite); at rows inside velocity and acceleration are those of the parabola through the
/// row and its neighbours. Two rows give the movement of least jerk (Flash and Hogan 1985).
class Path {
 public:
  Path() = default;  // no displacement at any time
  /// Throws InputError: times that do not ascend, a first displacement other than 0, values that are not finite.
  explicit Path(std::vector<PathRow> rows);

  Vec3 calc(double time_s) const;

 private:
  std::vector<PathRow> rows_;
  std::vector<Vec3> slope_m_s_, bend_m_s2_;  // (rows)
};

}  // namespace carillon::transient

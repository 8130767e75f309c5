// Axis labels: round tick values, short numbers, suitable units.
#pragma once

#include <string>
#include <vector>

namespace carillon::sound {

/// Tick label without exponent, at most six characters, in the given unit.
struct Label {
  std::string text, unit;
};

/// A pressure >= 0 [Pa] with two digits, in µPa, mPa, Pa or kPa (Pa from 0.01 to 999).
Label make_pressure_label(double pressure_pa);

struct AxisTick {
  double at_s = 0.0;
  std::string text;
};

struct TimeAxis {
  std::string unit;  // "s", "ms" or "µs"
  std::vector<AxisTick> marks;
};

/// Ticks from 0 to `duration_s` (> 0) in steps of 1, 2 or 5 times a power of ten, five to eleven of them; in seconds from 0.5 s on.
TimeAxis make_time_axis(double duration_s);

}  // namespace carillon::sound

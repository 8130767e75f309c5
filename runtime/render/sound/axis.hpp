// How the axes of pictures are labelled: round marks, short numbers, the unit that suits them.
#pragma once

#include <string>
#include <vector>

namespace carillon::sound {

/// A number as it stands next to an axis: no exponent, at most six characters, in the unit named.
struct Label {
  std::string text, unit;
};

/// A pressure >= 0 [Pa] to two digits, in µPa, mPa, Pa or kPa: 0.01 to 999 Pa stay in Pa.
Label make_pressure_label(double pressure_pa);

struct AxisTick {
  double at_s = 0.0;
  std::string text;
};

struct TimeAxis {
  std::string unit;  // "s", "ms" or "µs"
  std::vector<AxisTick> marks;
};

/// Marks from 0 to `duration_s` (> 0) in steps of 1, 2 or 5 times a power of ten, five to eleven of them; seconds from half a second on.
TimeAxis make_time_axis(double duration_s);

}  // namespace carillon::sound

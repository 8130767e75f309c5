#include "runtime/render/sound/axis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace carillon::sound {
namespace {

/// At most this many decimals, no exponent: 0.047, 4.7, 470.
std::string format_plain(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, std::max(0, decimals));
  if (text.find('.') == std::string::npos) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

/// Decimal exponent: 0 for 4.7, 2 for 470.
int find_exponent(double value) { return static_cast<int>(std::floor(std::log10(value) + 1e-9)); }

/// Rounds to significant digits, so 999.6 becomes 1000 before the unit is chosen.
double round_to(double value, int digits) {
  if (!(value > 0.0)) return 0.0;
  const double step = std::pow(10.0, find_exponent(value) - digits + 1);
  return std::round(value / step) * step;
}

}  // namespace

Label make_pressure_label(double pressure_pa) {
  struct Unit {
    double below_pa, per_pa;
    const char* name;
  };
  const double rounded = round_to(pressure_pa, 2);
  if (!(rounded > 0.0)) return {"0", "Pa"};
  for (const Unit& unit : {Unit{1e-5, 1e6, "µPa"}, Unit{1e-2, 1e3, "mPa"}, Unit{1e3, 1.0, "Pa"}}) {
    if (rounded < unit.below_pa * (1 - 1e-9))
      return {format_plain(rounded * unit.per_pa, 1 - find_exponent(rounded * unit.per_pa)), unit.name};
  }
  return {format_plain(rounded * 1e-3, 1 - find_exponent(rounded * 1e-3)), "kPa"};
}

TimeAxis make_time_axis(double duration_s) {
  TimeAxis axis;
  double factor = 1.0;
  axis.unit = "s";
  if (duration_s < 0.5e-3) {
    factor = 1e6;
    axis.unit = "µs";
  } else if (duration_s < 0.5) {
    factor = 1e3;
    axis.unit = "ms";
  }
  const double span = duration_s * factor;
  const double power = std::pow(10.0, std::floor(std::log10(span / 8)));
  double step = 10 * power;
  for (const double round : {5.0, 2.0, 1.0}) {
    if (round * power >= span / 8 * 0.999) step = round * power;
  }
  for (int i = 0; i * step <= span * (1 + 1e-9); ++i)
    axis.marks.push_back({i * step / factor, format_plain(i * step, -find_exponent(step))});
  return axis;
}

}  // namespace carillon::sound

// Source: Universal file datasets 58, 164 and 2411, SDRC I-DEAS (University of Cincinnati, SDRL).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

#include "runtime/exchange/frf.hpp"

namespace carillon::exchange {
namespace {

struct MotionNames {
  int type;  // of specific data
  const char *name, *unit;
};
constexpr std::array<MotionNames, 3> kMotions{{{8, "Displacement", "m"}, {11, "Velocity", "m/s"}, {12, "Acceleration", "m/s^2"}}};

}  // namespace

std::string format_frfs(const FrfSet& set, const std::string& name) {
  std::string text =
      fmt::format("    -1\n   164\n{:10}{:<20}{:10}\n{:25.16E}{:25.16E}{:25.16E}\n{:25.16E}\n    -1\n", 1, "SI", 2, 1.0, 1.0, 1.0, 273.15);
  const auto out = std::back_inserter(text);
  text += "    -1\n  2411\n";
  for (const auto& [node, x] : set.nodes_m)
    fmt::format_to(out, "{:10}{:10}{:10}{:10}\n{:25.16E}{:25.16E}{:25.16E}\n", node, 1, 1, 11, x[0], x[1], x[2]);
  text += "    -1\n";
  std::string title = name.substr(0, 80);
  std::replace_if(
      title.begin(), title.end(), [](unsigned char c) { return c < 32 || c > 126; }, '?');
  std::size_t number = 0;
  for (const Frf& frf : set.frfs) {
    const std::size_t lines = frf.freq_hz.size();
    const double step = lines > 1 ? (frf.freq_hz.back() - frf.freq_hz.front()) / static_cast<double>(lines - 1) : 0.0;
    const MotionNames& motion = kMotions[static_cast<std::size_t>(frf.motion)];
    fmt::format_to(out, "    -1\n    58\n{:<80}\n{:<80}\n{:<80}\n{:<80}\n{:<80}\n", title, "NONE", "NONE", "NONE", "NONE");
    fmt::format_to(out, "{:5}{:10}{:5}{:10} {:<10}{:10}{:4} {:<10}{:10}{:4}\n", 4, ++number, 0, 0, "NONE", frf.response_node,
                   frf.response_direction, "NONE", frf.reference_node, frf.reference_direction);
    fmt::format_to(out, "{:10}{:10}{:10}{:13.5E}{:13.5E}{:13.5E}\n", 6, lines, 1, frf.freq_hz.front(), step, 0.0);
    const auto axis = [&](int type, const char* label, const char* unit) {
      fmt::format_to(out, "{:10}{:5}{:5}{:5} {:<20} {:<20}\n", type, 0, 0, 0, label, unit);
    };
    axis(18, "Frequency", "Hz");
    axis(motion.type, motion.name, motion.unit);
    axis(13, "Force", "N");
    axis(0, "NONE", "NONE");
    for (std::size_t i = 0; i < lines; ++i) {
      fmt::format_to(out, "{:20.12E}{:20.12E}", frf.value[i].real(), frf.value[i].imag());
      if (i % 2 == 1 || i + 1 == lines) text += '\n';
    }
    text += "    -1\n";
  }
  return text;
}

}  // namespace carillon::exchange

#include "runtime/bank/heard.hpp"

#include <algorithm>

namespace carillon::bank {

const char* name_origin(const Bank& bank) {
  return bank.element == "analytic" ? "theory" : bank.element == "imported" ? "imported" : "mesh";
}

std::vector<HeardMode> list_heard(const Bank& played, std::span<const double> by_supports_per_s) {
  std::vector<HeardMode> heard;
  const bool has_air = played.multipoles.is_in_decay && !played.multipoles.is_empty();
  for (std::size_t m = 0; m < played.mode_count(); ++m) {
    HeardMode mode{.freq_hz = played.freq_hz(m)};
    if (has_air) mode.radiation_per_s = played.multipoles.decay_per_s[m];
    if (m < by_supports_per_s.size()) mode.supports_per_s = by_supports_per_s[m];
    mode.material_per_s = std::max(0.0, played.decay_per_s[m] - mode.radiation_per_s - mode.supports_per_s);
    heard.push_back(mode);
  }
  return heard;
}

}  // namespace carillon::bank

// Audible frequency and decay of modes, with the contributions to the decay.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Decay time by 60 dB, ln(1000) / d; infinite without damping.
inline double calc_t60_s(double decay_per_s) { return std::log(1000.0) / decay_per_s; }

/// Without multipoles the radiation part is unknown and contained in the material's.
struct HeardMode {
  double freq_hz = 0.0;  // undamped
  double material_per_s = 0.0, radiation_per_s = 0.0, supports_per_s = 0.0;

  double calc_decay_per_s() const { return material_per_s + radiation_per_s + supports_per_s; }
  double calc_t60_s() const { return bank::calc_t60_s(calc_decay_per_s()); }
};

/// Origin of a bank's frequencies: "mesh", "theory" or "imported".
const char* name_origin(const Bank& bank);

/// Modes of a bank prepared for playing (calc_corrected(), supports applied). `by_supports_per_s` (m): decay by supports; empty: none.
std::vector<HeardMode> list_heard(const Bank& played, std::span<const double> by_supports_per_s);

}  // namespace carillon::bank

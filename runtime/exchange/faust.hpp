// Modes of a bank as a Faust program: a filter from blows at a few points to the pressure at 1 m, and an instrument made of it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/acoustics/radiation/gains.hpp"

namespace carillon::exchange {

inline constexpr std::size_t kMaxFaustPoints = 64, kDefaultFaustPoints = 4;

struct FaustOptions {
  std::string name = "body";
  std::size_t modes = 100;       // number of modes: the loudest for blows at the points; all if there are fewer
  std::vector<Vec3> points_m{};  // in the frame of the mesh; the nearest points of the surface are struck. Empty: bank::find_strikes()
  std::size_t point_count = kDefaultFaustPoints;  // of those
  radiation::GainKind radiation = radiation::GainKind::kAuto;
};

struct FaustProgram {
  std::string text{};
  std::size_t modes = 0;  // in the program
  std::vector<Vec3> points_m{};
  double left_out_db = 0.0;  // A-weighted energy of the omitted modes over that of all, at the worst point; minus infinity: none is omitted
};

/// The impulse response of each mode is exact at any sample rate, over-damped modes included; a mode at or above the Nyquist frequency is
/// silent. The blow is along the inward normal. Plays the corrected frequencies, with the gains of a scene with that `radiation`.
/// Throws InputError for a bank without modes or surface, no modes asked for, and more than kMaxFaustPoints points.
FaustProgram make_faust(const bank::Bank& bank, const FaustOptions& options);

}  // namespace carillon::exchange

// Modes of a bank as a Faust program: filter from blows at a few points to the pressure at 1 m, and an instrument using it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::exchange {

inline constexpr std::size_t kMaxFaustPoints = 64, kDefaultFaustPoints = 4;

struct FaustOptions {
  std::string name = "body";
  std::size_t modes = 100;                        // loudest modes for blows at the points; all if there are fewer
  std::vector<Vec3> points_m{};                   // mesh axes, projected to the surface; empty: bank::find_strikes()
  std::size_t point_count = kDefaultFaustPoints;  // number of points from find_strikes()
  radiation::GainKind radiation = radiation::GainKind::kAuto;
};

struct FaustProgram {
  std::string text{};
  std::size_t modes = 0;  // modes in the program
  std::vector<Vec3> points_m{};
  double left_out_db = 0.0;  // A-weighted energy of the omitted modes over that of all, at the worst point; -infinity: none omitted
};

/// Exact impulse response of each mode at any sample rate, over-damped modes included; modes at or above the Nyquist frequency are silent.
/// Blows act along the inward normal. Corrected frequencies, gains of a scene with that `radiation`. Throws InputError for a bank without
/// modes or surface, zero modes, and more than kMaxFaustPoints points.
FaustProgram make_faust(const bank::Bank& bank, const FaustOptions& options);

}  // namespace carillon::exchange

// Modes of a bank as a Faust program: a filter from blows at a few points to the pressure at 1 m, and an instrument made of it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/radiation/gains.hpp"

namespace carillon::exchange {

inline constexpr std::size_t kMaxFaustPoints = 64, kDefaultFaustPoints = 4;

struct FaustOptions {
  std::string name = "body";
  std::size_t modes = 100;       // the loudest so many of blows at the points; all where there are fewer
  std::vector<Vec3> points_m{};  // of the frame of the mesh; the nearest places of the surface are struck. Empty: bank::find_strikes()
  std::size_t point_count = kDefaultFaustPoints;  // of those
  radiation::GainKind radiation = radiation::GainKind::kSphere;
};

struct FaustProgram {
  std::string text{};
  std::size_t modes = 0;  // that are in it
  std::vector<Vec3> points_m{};
  double left_out_db = 0.0;  // A-weighted energy of the modes that are not, over all, of the worst point; minus infinity: none is left out
};

/// Modes are answered exactly at any sample rate, those that do not swing too; one at or above the Nyquist frequency is silent. The blow
/// goes straight into the surface. Plays the corrected frequencies, with the gains that a scene of that `radiation` has.
/// Throws InputError for a bank without modes or surface, no modes asked for, and more than kMaxFaustPoints points.
FaustProgram make_faust(const bank::Bank& bank, const FaustOptions& options);

}  // namespace carillon::exchange

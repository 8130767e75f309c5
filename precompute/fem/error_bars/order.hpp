// From errors of single modes to errors of the k-th sorted frequency.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace carillon::error_bars {

/// Stated value and interval of each mode by itself; cents above its frequency on the mesh.
struct OwnIntervals {
  std::vector<double> stated;  // (m) 0: the mesh's frequency; otherwise the correction
  std::vector<double> low;     // (m) lower end of the interval, <= stated
  std::vector<double> high;    // (m) upper end, >= stated
  std::vector<double> above;   // (m) upper end without correction: uncertainty of a lumped mass and of a surface cut short
};

/// Unlisted modes of the mesh.
struct Unlisted {
  double high_hz = 0.0;    // lower bound of those above, or the last listed one, if higher
  double low_hz = 0.0;     // upper bound of those below
  std::int64_t below = 0;  // number below, without rigid modes
};

/// Least lambda [rad^2/s^2] of unlisted modes above the list if they move as those near its end do. moved: (m) cents above the frequency on
/// the mesh: OwnIntervals::low gives a bound of the true values, OwnIntervals::stated the stated ones. Other arguments as below. Pure.
double find_lowest_unlisted(std::span<const double> lambda, std::span<const double> moved, const Unlisted& unlisted);

/// Greatest lambda [rad^2/s^2] of unlisted modes below the list if they move up as those near its beginning do; 0 without any. moved: as
/// above: OwnIntervals::above gives a bound of the true values. Pure.
double find_highest_unlisted(std::span<const double> lambda, std::span<const double> moved, const Unlisted& unlisted);

/// Bars [cents] of the stated frequencies: the k-th lowest of them is within its bar of the k-th true one, k counting unlisted modes below
/// too. lambda: (m) of the mesh, ascending, m > 0. Returns (m), in the order of lambda. Pure.
std::vector<double> widen_for_order(std::span<const double> lambda, const OwnIntervals& own, const Unlisted& unlisted);

}  // namespace carillon::error_bars

// From how wrong each mode is to how wrong the k-th of the sorted frequencies is.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace carillon::error_bars {

/// What is stated of each mode by itself, and where its true frequency can be; cents above its frequency on the mesh.
struct OwnIntervals {
  std::vector<double> stated;  // (m) 0: the mesh's frequency; otherwise the correction
  std::vector<double> low;     // (m) lower end of the interval, <= stated
  std::vector<double> high;    // (m) upper end, >= stated
  std::vector<double> above;   // (m) upper end for a mode that is not corrected: what a lumped mass and a surface cut short leave open
};

/// The modes of the mesh that are not in the list.
struct Unlisted {
  double high_hz = 0.0;    // those above lie at least here; or above the last of the list, if that is higher
  double low_hz = 0.0;     // those below lie at most here
  std::int64_t below = 0;  // how many, rigid ones left out
};

/// The bars [cents] of the stated frequencies: the k-th lowest of them is within its bar of the k-th true one, k counting what is unlisted
/// below too. lambda: (m) of the mesh, ascending, m > 0. Returns (m), in the order of lambda. Pure.
std::vector<double> widen_for_order(std::span<const double> lambda, const OwnIntervals& own, const Unlisted& unlisted);

}  // namespace carillon::error_bars

// From how wrong each mode is to how wrong the k-th of the sorted frequencies is.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace carillon::estimate {

/// What a mode by itself can be wrong by, cents.
struct OwnBars {
  std::span<const double> cents;        // (m) to either side
  std::span<const double> cents_above;  // (m) by which the truth can lie above: what a lumped mass and a surface cut short leave open
};

/// The modes of the mesh that are not in the list.
struct Unlisted {
  double high_hz = 0.0;    // those above lie at least here; or above the last of the list, if that is higher
  double low_hz = 0.0;     // those below lie at most here
  std::int64_t below = 0;  // how many, rigid ones left out
};

/// The bars [cents] of the k-th lowest, k counting what is unlisted below too. lambda: (m) ascending, m > 0. Pure.
std::vector<double> widen_for_order(std::span<const double> lambda, const OwnBars& own, const Unlisted& unlisted);

}  // namespace carillon::estimate

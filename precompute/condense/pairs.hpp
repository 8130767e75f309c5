// The products q_i q_j of the coordinates of N modes, i <= j.
#pragma once

#include <cstddef>

namespace carillon::condense {

/// N (N + 1) / 2 pairs, in the order of bank::QuarticEnergy: by columns of the upper triangle.
struct Pairs {
  std::ptrdiff_t modes = 0;

  std::ptrdiff_t count() const { return modes * (modes + 1) / 2; }
  /// Pre: 0 <= i <= j < modes.
  std::ptrdiff_t find(std::ptrdiff_t i, std::ptrdiff_t j) const { return j * (j + 1) / 2 + i; }
};

}  // namespace carillon::condense

// Index of the products q_i q_j of N modal coordinates, i <= j.
#pragma once

#include <cstddef>

#include "runtime/bank/quartic_energy.hpp"

namespace carillon::coupling {

/// N (N + 1) / 2 pairs, in the order of bank::QuarticEnergy: columns of the upper triangle.
struct Pairs {
  std::ptrdiff_t modes = 0;

  std::ptrdiff_t count() const { return static_cast<std::ptrdiff_t>(bank::count_pairs(static_cast<std::size_t>(modes))); }
  /// Pre: 0 <= i <= j < modes.
  std::ptrdiff_t find(std::ptrdiff_t i, std::ptrdiff_t j) const {
    return static_cast<std::ptrdiff_t>(bank::find_pair(static_cast<std::size_t>(i), static_cast<std::size_t>(j)));
  }
};

}  // namespace carillon::coupling

// Pseudo-random numbers that are the same for any number of ranks.
#pragma once

#include <cstdint>

#include "runtime/base/chance.hpp"

namespace carillon::petsc {

using base::scramble;

/// In [-1/2, 1/2), from scrambled bits.
constexpr double to_noise(std::uint64_t bits) { return static_cast<double>(bits >> 11) * 0x1.0p-53 - 0.5; }

/// In [-1/2, 1/2), a function of two numbers.
constexpr double make_noise(std::uint64_t a, std::uint64_t b) {
  return to_noise(scramble(a * 0x9E3779B97F4A7C15ull + b * 0xD1B54A32D192ED03ull + 0x8CB92BA72F3D8DD7ull));
}

}  // namespace carillon::petsc

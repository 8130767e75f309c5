// Numbers that look random and are the same on every rank, for any number of ranks.
#pragma once

#include <cstdint>

namespace carillon::petsc {

/// The finaliser of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014).
constexpr std::uint64_t scramble(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31);
}

/// In [-1/2, 1/2), from scrambled bits.
constexpr double to_noise(std::uint64_t bits) { return static_cast<double>(bits >> 11) * 0x1.0p-53 - 0.5; }

/// In [-1/2, 1/2), from two numbers alone.
constexpr double make_noise(std::uint64_t a, std::uint64_t b) {
  return to_noise(scramble(a * 0x9E3779B97F4A7C15ull + b * 0xD1B54A32D192ED03ull + 0x8CB92BA72F3D8DD7ull));
}

}  // namespace carillon::petsc

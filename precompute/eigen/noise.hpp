// Numbers that look random and are the same everywhere.
#pragma once

#include <cstdint>

namespace carillon::eigen {

/// In (-1/2, 1/2), from the arguments alone (the finaliser of SplitMix64: Steele, Lea, Flood, OOPSLA 2014).
inline double make_noise(std::uint64_t a, std::uint64_t b) {
  std::uint64_t x = a * 0x9E3779B97F4A7C15ull + b * 0xD1B54A32D192ED03ull + 0x8CB92BA72F3D8DD7ull;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return static_cast<double>((x ^ (x >> 31)) >> 11) * 0x1.0p-53 - 0.5;
}

}  // namespace carillon::eigen

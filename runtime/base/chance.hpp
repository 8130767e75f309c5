// Reproducible pseudo-random numbers, equal on all machines.
#pragma once

#include <cstdint>
#include <string_view>

namespace carillon::base {

/// State increment of splitmix64.
inline constexpr std::uint64_t kChanceStep = 0x9e3779b97f4a7c15U;

/// Finaliser of splitmix64 (Steele, Lea and Flood 2014).
constexpr std::uint64_t scramble(std::uint64_t x) noexcept {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31);
}

/// The next number of splitmix64.
constexpr std::uint64_t draw(std::uint64_t& state) noexcept { return scramble(state += kChanceStep); }

/// In [0, 1), from the upper 53 bits.
constexpr double to_unit(std::uint64_t bits) noexcept { return static_cast<double>(bits >> 11) * 0x1p-53; }

/// FNV-1a (Fowler, Noll and Vo 1991).
constexpr std::uint64_t hash_name(std::string_view name) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  return hash;
}

}  // namespace carillon::base

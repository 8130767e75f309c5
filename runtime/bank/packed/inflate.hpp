// Inflate for zlib streams (RFC 1950).
#pragma once

#include <cstdint>
#include <span>

namespace carillon::packed {

/// Maximum expansion of a deflate stream (Deutsch, RFC 1951: a match of 258 bytes takes two bits).
inline constexpr std::size_t kMaxInflation = 1032;

/// Memory limit for unpacking so many bytes, so that a small file cannot exhaust memory. Smooth bodies with ten modes expand about 100
/// times.
constexpr std::uint64_t find_most_unpacked(std::uint64_t packed) {
  constexpr std::uint64_t kAlways = 64 << 20, kTimes = 4096;
  return packed > kAlways / kTimes ? kTimes * packed : kAlways;
}

/// Inflates a zlib stream into `bytes`. False if it is damaged or of another length. Thread-safe. Uses libdeflate; in WebAssembly the
/// decoder of stb_image, which comes with its compiler.
bool inflate(std::span<const std::uint8_t> stream, std::span<std::uint8_t> bytes);

}  // namespace carillon::packed

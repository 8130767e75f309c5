// Bytes of the zlib format (RFC 1950), the one that every system and every browser can read.
#pragma once

#include <cstdint>
#include <span>

namespace carillon::packed {

/// No stream of the format holds more than so many times its length (Deutsch, RFC 1951: a match of 258 bytes takes two bits).
inline constexpr std::size_t kMaxInflation = 1032;

/// What so many packed bytes may become in memory, at most: a file of some kilobytes cannot take all memory of a machine. Shapes of a
/// smooth body with ten modes become a hundred times what they were.
constexpr std::uint64_t find_most_unpacked(std::uint64_t packed) {
  constexpr std::uint64_t kAlways = 64 << 20, kTimes = 4096;
  return packed > kAlways / kTimes ? kTimes * packed : kAlways;
}

/// Fills `bytes` with what a zlib stream holds. False when the stream is damaged or holds another number of bytes. Any thread. Uses
/// libdeflate, and in WebAssembly the decoder of stb_image, which its compiler brings along.
bool inflate(std::span<const std::uint8_t> stream, std::span<std::uint8_t> bytes);

}  // namespace carillon::packed

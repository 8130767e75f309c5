// SHA-256 without OpenSSL, for WebAssembly. Use sha256.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace carillon::base {

/// Incremental hash (FIPS 180-4, 6.2). Invariant: `state_` is the hash of all complete blocks of 64 bytes, `block_` begins with the bytes
/// after them.
class PlainSha256 {
 public:
  void add(std::span<const std::byte> bytes) noexcept;
  /// Call once.
  std::array<unsigned char, 32> finish() noexcept;

 private:
  void take_block(const unsigned char* block) noexcept;

  std::array<std::uint32_t, 8> state_{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<unsigned char, 64> block_{};
  std::uint64_t size_ = 0;  // bytes so far
};

}  // namespace carillon::base

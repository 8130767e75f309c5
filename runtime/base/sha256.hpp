// SHA-256 (FIPS 180-4), by OpenSSL; in WebAssembly by sha256_plain.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace carillon::base {

/// The hash of bytes that come in pieces.
class Sha256 {
 public:
  using Hash = std::array<unsigned char, 32>;

  /// Throws SystemError where OpenSSL offers no SHA-256.
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void add(std::span<const std::byte> bytes);
  void add(std::string_view bytes);
  /// Once only.
  Hash finish();

 private:
  void* context_ = nullptr;
};

Sha256::Hash calc_sha256(std::string_view bytes);

/// Two lower-case digits a byte.
std::string to_hex(std::span<const unsigned char> bytes);

}  // namespace carillon::base

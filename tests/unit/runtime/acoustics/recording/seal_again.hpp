// Damaged files with a valid seal.
#pragma once

#include <string>
#include <string_view>

#include "runtime/acoustics/recording/header.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::recording::testing {

/// Bytes with correct length and digest; unchanged if not a header.
inline std::string seal_again(std::string bytes) {
  if (bytes.size() < kHeaderBytes) return bytes;
  const std::size_t at = bytes.find("\nlength "), end = at == bytes.npos ? at : bytes.find('\n', at + 1);
  if (end != bytes.npos && end < kTextBytes - 20) {
    std::string text = bytes.substr(0, kTextBytes);
    text.replace(at, end - at, "\nlength " + std::to_string(bytes.size()));
    text.resize(kTextBytes, '\n');
    bytes.replace(0, kTextBytes, text);
  }
  base::Sha256 sha;
  sha.add(std::string_view(bytes).substr(0, kTextBytes));
  sha.add(std::string_view(bytes).substr(kHeaderBytes));
  bytes.replace(kTextBytes, kDigestBytes, base::to_hex(sha.finish()));
  return bytes;
}

}  // namespace carillon::recording::testing

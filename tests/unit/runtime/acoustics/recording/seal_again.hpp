// Damage behind a good seal.
#pragma once

#include <string>
#include <string_view>

#include "runtime/base/sha256.hpp"
#include "runtime/acoustics/recording/header.hpp"

namespace carillon::recording::testing {

/// The bytes with the length and the digest that they ought to have; others than those of a header stay as they are.
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

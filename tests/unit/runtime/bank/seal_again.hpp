// Renewal of the seal of modified bank bytes.
#pragma once

#include <span>
#include <string>

#include "runtime/bank/seal.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::bank {

/// Corrects the length in line 2 and the SHA-256.
inline std::string seal_again(std::string bytes) {
  const std::size_t line = bytes.find('\n') + 1;
  const std::size_t end = bytes.find('\n', line);
  if (line == 0 || end == std::string::npos || end >= kTextBytes || bytes.size() < kSealBytes) return bytes;
  std::string length = "length " + std::to_string(bytes.size());
  if (line + length.size() > kTextBytes) return bytes;
  // The text keeps its position: a change of digits is taken from the padding at its end.
  std::string text = bytes.substr(0, line) + length + bytes.substr(end, kTextBytes - end);
  text.resize(kTextBytes, '\n');
  bytes.replace(0, kTextBytes, text);
  base::Sha256 digest;
  const auto all = std::as_bytes(std::span(bytes));
  digest.add(all.first(kTextBytes));
  digest.add(all.subspan(kSealBytes));
  bytes.replace(kTextBytes, kDigestBytes, base::to_hex(digest.finish()));
  return bytes;
}

}  // namespace carillon::bank

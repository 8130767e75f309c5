// Seal of a bank file: its first 4096 bytes, plain text with version, position of each array, and the SHA-256 of all other bytes.
// docs/bank-format.md. Internal to carillon::bank.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

inline constexpr std::size_t kSealBytes = 4096;                       // the HDF5 user block of the file
inline constexpr std::size_t kDigestBytes = 64;                       // hexadecimal SHA-256, the last bytes of the seal
inline constexpr std::size_t kTextBytes = kSealBytes - kDigestBytes;  // the text, padded with line feeds

/// Position of an array.
struct Extent {
  std::string dtype;
  std::uint64_t offset = 0;  // from the start of the file
  std::vector<std::uint64_t> shape;
  std::uint64_t bytes = 0;
};

/// Parsed seal: known major version, arrays inside the file, sum of sizes at most the file's length.
struct Seal {
  int major = 0;
  int minor = 0;
  std::uint64_t length = 0;  // of the whole file
  std::map<std::string, Extent> extents;
  std::string digest;
};

/// Parses the seal of a file of `length` bytes (`head`: its first 4096 bytes, or fewer). Checks magic, version, length and table, in this
/// order, not the digest. Throws InputError; `name` is the file.
Seal parse_seal(std::string_view head, std::uint64_t length, const std::string& name);

/// Text of a seal, kTextBytes long, for a file of `length` bytes and a version (major, minor). InputError if the table does not fit.
std::string format_seal_text(std::uint64_t length, const std::array<int, 2>& version, const std::map<std::string, Extent>& extents);

}  // namespace carillon::bank

// Truncation of names.
#pragma once

#include <string>

namespace carillon::explore {

/// Truncates to 100 bytes at a character boundary: space for suffixes, and the limit of body names.
inline std::string cut_name(std::string name) {
  constexpr std::size_t kMost = 100;
  if (name.size() <= kMost) return name;
  std::size_t end = kMost;
  while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xC0) == 0x80) --end;
  name.resize(end);
  return name;
}

}  // namespace carillon::explore

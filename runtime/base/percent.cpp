#include "runtime/base/percent.hpp"

#include <charconv>

namespace carillon::base {

std::optional<std::string> decode_percent(std::string_view uri) {
  std::string text;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      text += uri[i];
      continue;
    }
    unsigned value = 0;
    const char* const begin = uri.data() + i + 1;
    if (uri.size() - i < 3 || std::from_chars(begin, begin + 2, value, 16).ptr != begin + 2 || value == 0) return std::nullopt;
    text += static_cast<char>(value);
    i += 2;
  }
  return text;
}

}  // namespace carillon::base

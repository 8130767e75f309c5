// Paths as text.
#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "jobs/store/records.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::store {
namespace {

/// Control and bidirectional characters beyond C0.
bool is_control(std::uint32_t code) {
  return (code >= 0x7F && code < 0xA0) || code == 0x61C || code == 0x200E || code == 0x200F || (code >= 0x2028 && code <= 0x202E) ||
         (code >= 0x2066 && code <= 0x2069);
}

int find_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

}  // namespace

std::string to_text(const std::filesystem::path& path) {
  const std::string& bytes = path.native();
  std::string text;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t length = base::decode_utf8(std::string_view(bytes).substr(at)).bytes;
    const bool is_escape = bytes[at] == '\\' && at + 1 < bytes.size() && bytes[at + 1] == 'x';
    if (length == 0 || is_escape)
      text += fmt::format("\\x{:02x}", static_cast<unsigned char>(bytes[at]));
    else
      text.append(bytes, at, length);
    at += length == 0 ? 1 : length;
  }
  return text;
}

std::filesystem::path from_text(const std::string& text) {
  std::string bytes;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const bool is_escape =
        text.compare(at, 2, "\\x") == 0 && at + 3 < text.size() && find_digit(text[at + 2]) >= 0 && find_digit(text[at + 3]) >= 0;
    if (!is_escape) {
      bytes += text[at];
      continue;
    }
    bytes += static_cast<char>(find_digit(text[at + 2]) * 16 + find_digit(text[at + 3]));
    at += 3;
  }
  return bytes;
}

std::string to_plain_json(const std::string& json) {
  std::string result;
  for (std::string_view rest = json; !rest.empty();) {
    const base::Character character = base::decode_utf8(rest);
    const std::size_t bytes = std::max<std::size_t>(character.bytes, 1);
    if (is_control(character.code))
      base::append_unicode_escape(result, character.code);
    else
      result += rest.substr(0, bytes);
    rest.remove_prefix(bytes);
  }
  return result;
}

std::string find_input_name(const Request& request) { return from_text(request.input_file).filename().string(); }

}  // namespace carillon::store

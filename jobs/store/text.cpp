// Paths as text.
#include <fmt/core.h>

#include "jobs/store/records.hpp"

namespace carillon::store {
namespace {

/// Length of the UTF-8 character at `at`; 0 if invalid.
std::size_t find_character(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  const unsigned first = byte(at);
  const std::size_t length = first < 0x80                    ? 1
                             : first >= 0xC2 && first < 0xE0 ? 2
                             : first >= 0xE0 && first < 0xF0 ? 3
                             : first >= 0xF0 && first < 0xF5 ? 4
                                                             : 0;
  if (length == 0) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0U) != 0x80U) return 0;
  }
  const unsigned second = byte(at + 1);
  // Overlong forms, surrogates, above U+10FFFF (RFC 3629, section 4).
  if ((first == 0xE0 && second < 0xA0) || (first == 0xED && second > 0x9F) || (first == 0xF0 && second < 0x90) ||
      (first == 0xF4 && second > 0x8F))
    return 0;
  return length;
}

/// Length in bytes of a control or bidirectional character at `at`, else 0: C0, DEL, C1 (U+0080 - U+009F), U+061C, U+200E, U+200F,
/// U+2028 - U+202E, U+2066 - U+2069.
std::size_t find_control(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  const unsigned a = byte(at), b = byte(at + 1), c = byte(at + 2);
  if (a < 0x20 || a == 0x7F) return 1;
  if (a == 0xC2 && b < 0xA0) return 2;
  if (a == 0xD8 && b == 0x9C) return 2;
  if (a == 0xE2 && b == 0x80 && (c == 0x8E || c == 0x8F || (c >= 0xA8 && c <= 0xAE))) return 3;
  if (a == 0xE2 && b == 0x81 && c >= 0xA6 && c <= 0xA9) return 3;
  return 0;
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
    const std::size_t length = find_character(bytes, at);
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
  for (std::size_t at = 0; at < json.size();) {
    const std::size_t control = find_control(json, at);
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(json[at + i]); };
    if (control < 2 && byte(0) != 0x7F) {
      result += json[at++];
      continue;
    }
    const unsigned code = control == 1   ? 0x7FU
                          : control == 2 ? (byte(0) & 0x1FU) << 6U | (byte(1) & 0x3FU)
                                         : (byte(0) & 0xFU) << 12U | (byte(1) & 0x3FU) << 6U | (byte(2) & 0x3FU);
    result += fmt::format("\\u{:04x}", code);
    at += control;
  }
  return result;
}

std::string find_input_name(const Request& request) { return from_text(request.input_file).filename().string(); }

}  // namespace carillon::store

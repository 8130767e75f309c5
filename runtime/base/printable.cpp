// Source: RFC 3629 (UTF-8); Unicode 15, general categories Cc, Cf, Zl and Zp.
// Deviations: of Cf, soft hyphen, joiners U+200C and U+200D and marks of single scripts are kept: they belong to words.
#include "runtime/base/printable.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

namespace carillon::base {
namespace {

bool is_hidden(std::uint32_t code) {
  constexpr std::uint32_t kRanges[][2]{{0x00, 0x1F},     {0x7F, 0x9F},       {0x61C, 0x61C},    {0x180E, 0x180E}, {0x200B, 0x200B},
                                       {0x200E, 0x200F}, {0x2028, 0x202E},   {0x2060, 0x206F},  {0xFEFF, 0xFEFF}, {0xFFF9, 0xFFFB},
                                       {0xFFFE, 0xFFFF}, {0x1D173, 0x1D17A}, {0xE0000, 0xE007F}};
  return std::any_of(std::begin(kRanges), std::end(kRanges), [&](const auto& range) { return code >= range[0] && code <= range[1]; });
}

std::string escape(std::string_view text, bool keeps_lines) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const auto [code, bytes] = decode_utf8(text);
    if (bytes == 0) {
      fmt::format_to(std::back_inserter(out), "\\x{:02x}", static_cast<unsigned char>(text[0]));
    } else if (!is_hidden(code) || (keeps_lines && (code == '\n' || code == '\t'))) {
      out += text.substr(0, bytes);
    } else if (code == '\n' || code == '\t' || code == '\r') {
      out += code == '\n' ? "\\n" : code == '\t' ? "\\t" : "\\r";
    } else {
      fmt::format_to(std::back_inserter(out), "\\{}{:0{}x}", code > 0xFFFF ? 'U' : 'u', code, code > 0xFFFF ? 8 : 4);
    }
    text.remove_prefix(std::max<std::size_t>(bytes, 1));
  }
  return out;
}

}  // namespace

Character decode_utf8(std::string_view text) {
  const auto first = static_cast<unsigned char>(text[0]);
  if (first < 0x80) return {first, 1};
  const std::size_t bytes = first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : first < 0xF5 ? 4 : 0;
  if (bytes == 0 || text.size() < bytes) return {};
  std::uint32_t code = first & (0xFFU >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    const auto next = static_cast<unsigned char>(text[i]);
    if ((next & 0xC0U) != 0x80U) return {};
    code = code << 6U | (next & 0x3FU);
  }
  constexpr std::array<std::uint32_t, 5> kMin{0, 0, 0x80, 0x800, 0x10000};
  const bool is_surrogate = code >= 0xD800 && code <= 0xDFFF;
  if (code < kMin[bytes] || is_surrogate || code > 0x10FFFF) return {};
  return {code, bytes};
}

void append_unicode_escape(std::string& out, std::uint32_t code) {
  if (code <= 0xFFFF)
    fmt::format_to(std::back_inserter(out), "\\u{:04x}", code);
  else
    fmt::format_to(std::back_inserter(out), "\\u{:04x}\\u{:04x}", 0xD7C0 + (code >> 10U), 0xDC00 + (code & 0x3FFU));
}

std::string printable(std::string_view text) { return escape(text, false); }
std::string printable_lines(std::string_view text) { return escape(text, true); }

std::string quote(std::string_view text) {
  std::string out = "\"";
  out.reserve(text.size() + 2);
  while (!text.empty()) {
    const auto [code, bytes] = decode_utf8(text);
    if (bytes == 1 && (code == '"' || code == '\\')) {
      out += '\\';
      out += text[0];
    } else if (bytes == 0 || !is_hidden(code)) {
      out += text.substr(0, std::max<std::size_t>(bytes, 1));
    } else {
      append_unicode_escape(out, code);
    }
    text.remove_prefix(std::max<std::size_t>(bytes, 1));
  }
  return out + '"';
}

}  // namespace carillon::base

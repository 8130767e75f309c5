// Untrusted text for terminals and JSON.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace carillon::base {

struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 0;  // 0: not valid UTF-8
};
/// First character of a text in UTF-8 that is not empty.
Character decode_utf8(std::string_view text);

/// Appends \uNNNN, or a surrogate pair of them.
void append_unicode_escape(std::string& out, std::uint32_t code);

/// One line without terminal control: C0 and C1 controls, DEL, bidirectional marks, line and paragraph separators and invisible format
/// characters become JSON escapes (\n, \t, \u001b; \U000e0041 beyond four digits); bytes that are not UTF-8 become \x9b.
std::string printable(std::string_view text);

/// The same, but keeps line feeds and tabs.
std::string printable_lines(std::string_view text);

/// JSON string literal in quotation marks. The characters above become \uNNNN; bytes that are not UTF-8 stay.
std::string quote(std::string_view text);

}  // namespace carillon::base

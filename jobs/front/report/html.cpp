// Method:     text is gone through by code points; those that a browser would not show as text are spelled out.
// Source:     RFC 3629 (UTF-8), Unicode Standard Annex 9 (controls of direction), HTML Living Standard 13.1 (what has to be escaped).
// Deviations: none.
#include "jobs/front/report/html.hpp"

#include <algorithm>

namespace carillon::report {
namespace {

/// Bytes of the code point that begins there, and the code point; 0 bytes for what is no UTF-8.
std::pair<std::size_t, char32_t> decode(std::string_view text, std::size_t at) {
  const auto get = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = get(at);
  if (first < 0x80) return {1, first};
  const std::size_t length = first >= 0xf0 && first < 0xf5 ? 4 : first >= 0xe0 && first < 0xf0 ? 3 : first >= 0xc2 && first < 0xe0 ? 2 : 0;
  if (length == 0 || at + length > text.size()) return {0, 0};
  char32_t point = first & (0x7fU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((get(at + i) & 0xc0U) != 0x80U) return {0, 0};
    point = point << 6U | (get(at + i) & 0x3fU);
  }
  const bool is_overlong = (length == 3 && point < 0x800) || (length == 4 && point < 0x10000);
  const bool is_surrogate = point >= 0xd800 && point < 0xe000;
  return is_overlong || is_surrogate || point > 0x10ffff ? std::pair<std::size_t, char32_t>{0, 0} : std::pair{length, point};
}

/// Whether it is no letter but does something: controls, line separators, marks and overrides of direction, invisible joins, tags.
bool is_control(char32_t point) {
  return point < 0x20 || (point >= 0x7f && point < 0xa0) || point == 0xad || point == 0x61c || (point >= 0x200b && point <= 0x200f) ||
         (point >= 0x2028 && point <= 0x202e) || (point >= 0x2060 && point <= 0x206f) || point == 0xfeff ||
         (point >= 0xfff9 && point <= 0xfffb) || (point & 0xfffe) == 0xfffe || (point >= 0xe0000 && point < 0xe0080);
}

const char* find_entity(char c) {
  switch (c) {
    case '&':
      return "&amp;";
    case '<':
      return "&lt;";
    case '>':
      return "&gt;";
    case '"':
      return "&quot;";
    case '\'':
      return "&#39;";
    default:
      return nullptr;
  }
}

}  // namespace

Html escape(std::string_view text, std::size_t max) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const auto [length, point] = decode(text, at);
    if (at + length > max) {
      out += "\u2026";
      break;
    }
    if (length == 0) {
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[at]));
    } else if (point == '\n') {
      out += '\n';
    } else if (is_control(point)) {
      out +=
          point < 0x100 ? fmt::format("\\x{:02x}", static_cast<unsigned>(point)) : fmt::format("\\u{:04x}", static_cast<unsigned>(point));
    } else if (const char* entity = find_entity(text[at])) {
      out += entity;
    } else {
      out += text.substr(at, length);
    }
    at += std::max<std::size_t>(length, 1);
  }
  return Html(std::move(out));
}

void Table::add(const std::vector<Html>& cells) {
  rows_ += html("<tr>");
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const Html cell = i < cells.size() ? cells[i] : Html();
    rows_ += columns_[i].is_number ? html("<td class=\"n\">{}</td>", cell) : html("<td>{}</td>", cell);
  }
  rows_ += html("</tr>\n");
}

Html Table::finish() const {
  if (empty()) return {};
  Html head;
  for (const Column& column : columns_)
    head += column.is_number ? html("<th class=\"n\">{}</th>", column.head) : html("<th>{}</th>", column.head);
  return html("<div class=\"table\"><table>\n<thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody></table></div>\n", head, rows_);
}

void Facts::add(std::string_view what, const Html& value, std::string_view remark) {
  rows_ += html("<tr><th>{}</th><td class=\"n\">{}</td><td class=\"remark\">{}</td></tr>\n", what, value, remark);
}

Html Facts::finish() const {
  if (empty()) return {};
  return html("<div class=\"table\"><table class=\"facts\"><tbody>\n{}</tbody></table></div>\n", rows_);
}

Html make_section(const char* id, const char* heading, const Html& content) {
  return html("<section id=\"{}\">\n<h2>{}</h2>\n{}</section>\n", id, heading, content);
}

Html make_note(const std::vector<std::string>& texts) {
  Html items;
  for (const std::string& text : texts) items += html("<li>{}</li>\n", escape(text, 1000));
  return items.empty() ? Html() : html("<div class=\"note\"><ul>\n{}</ul></div>\n", items);
}

Html leave_out(const char* id, const char* heading, std::string_view why) {
  return html("<section id=\"{}\" class=\"missing\">\n<h2>{}</h2>\n<p class=\"missing\">Left out: {}</p>\n</section>\n", id, heading, why);
}

}  // namespace carillon::report

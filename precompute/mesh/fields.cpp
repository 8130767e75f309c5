#include "precompute/mesh/fields.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>

namespace carillon::mesh {

namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

bool read_real(std::string_view text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

/// With a Fortran exponent: D, or none between the digits and its sign.
std::string to_c_number(std::string_view field) {
  std::string text;
  for (std::size_t i = 0; i < field.size(); ++i) {
    const char c = field[i];
    const bool is_sign = (c == '+' || c == '-') && !text.empty() && text.back() != 'e';
    if (is_sign) text += 'e';
    if (c == 'D' || c == 'd' || c == 'E') {
      text += 'e';
    } else if (c != '+' || !text.empty()) {
      text += c;
    }
  }
  std::erase(text, '+');
  return text;
}

}  // namespace

std::string_view trim(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string to_upper(std::string_view text) {
  std::string upper(text);
  std::transform(upper.begin(), upper.end(), upper.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return upper;
}

void split(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  while (!line.empty()) {
    const std::size_t comma = line.find(',');
    fields.push_back(trim(line.substr(0, comma)));
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
    if (trim(line).empty()) return;
  }
}

double parse_real(const Cursor& cursor, std::size_t place, std::string_view field, const char* what) {
  double value = 0.0;
  if (read_real(field, value) || read_real(to_c_number(field), value)) return value;
  cursor.fail(place, "expected {} (a number), found {}; a number is missing or damaged: write the file again", what, quote_excerpt(field));
}

std::int64_t parse_int(const Cursor& cursor, std::size_t place, std::string_view field, const char* what) {
  const std::string_view whole = field;
  if (field.size() > 1 && field[0] == '+') field.remove_prefix(1);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc{} || end != field.data() + field.size())
    cursor.fail(place, "expected {} (a whole number), found {}; a number is missing or damaged: write the file again", what,
                quote_excerpt(whole));
  return value;
}

bool is_int(std::string_view field) {
  if (!field.empty() && (field[0] == '+' || field[0] == '-')) field.remove_prefix(1);
  return !field.empty() && std::all_of(field.begin(), field.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

}  // namespace carillon::mesh

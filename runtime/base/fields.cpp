#include "runtime/base/fields.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>

namespace carillon::base {
namespace {

bool is_padding(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

template <class T>
std::optional<T> read_whole(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
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
  while (!text.empty() && is_padding(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_padding(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view unquote(std::string_view text) {
  text = trim(text);
  if (text.size() >= 2 && (text.front() == '"' || text.front() == '\'') && text.back() == text.front())
    text = text.substr(1, text.size() - 2);
  return trim(text);
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

std::optional<double> find_real(std::string_view field) {
  if (const auto value = read_whole<double>(field)) return value;
  return read_whole<double>(to_c_number(field));
}

std::optional<std::int64_t> find_int(std::string_view field) {
  if (field.size() > 1 && field[0] == '+') field.remove_prefix(1);
  return read_whole<std::int64_t>(field);
}

}  // namespace carillon::base

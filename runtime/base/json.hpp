// JSON writer. Members keep their insertion order, so equal values give equal bytes. document.hpp reads.
//
//   base::Json report = base::Json::object();
//   report.set("bank", path.string()).set("seconds", base::decimals(seconds, 3)).set("need_bytes", need);   // need: std::optional
//   for (const Body& body : bodies) report.member("bodies").add(body.name);
//   base::write_file(file, report.text());
//
// Distinct values may be used in different threads; no MPI.
#pragma once

#include <concepts>
#include <cstddef>
#include <optional>
#include <ranges>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace carillon::base {

/// JSON value. Invariant: line() and text() are valid JSON (RFC 8259) if strings are UTF-8: finite numbers, unique keys.
class Json {
 public:
  Json() = default;  // null
  Json(std::same_as<bool> auto value) : text_(value ? "true" : "false") {}
  Json(std::integral auto value) requires(!std::same_as<decltype(value), bool>) : text_(std::to_string(value)) {}
  /// Shortest form that reads back as the same number. Throws std::invalid_argument for infinity and NaN.
  Json(double value);
  /// Escaped by quote() of printable.hpp.
  Json(std::string_view value);
  Json(const std::string& value) : Json(std::string_view(value)) {}
  Json(const char* value) : Json(std::string_view(value)) {}
  /// null if empty.
  template <class T>
  Json(const std::optional<T>& value) : Json(value ? Json(*value) : Json()) {}

  static Json object();
  static Json array();
  template <std::ranges::input_range Range>
  static Json array(const Range& values) {
    Json list = array();
    for (const auto& value : values) list.add(Json(value));
    return list;
  }

  /// Sets a member; null becomes an object. An existing key keeps its position. std::logic_error for other kinds.
  Json& set(std::string_view key, Json value);
  /// Member by key, created as null.
  Json& member(std::string_view key);
  /// Appends an element; null becomes an array. std::logic_error for other kinds.
  Json& add(Json value);

  /// One line: {"a": 1, "b": [2, 3]}, no trailing newline.
  std::string line() const;
  /// Indented by two spaces; values that fit into `columns` stay on one line; trailing newline.
  std::string text(std::size_t columns = 120) const;

 private:
  friend Json significant(double value, int digits);
  friend Json decimals(double value, int places);
  enum class Kind { scalar, array, object };
  Json(Kind kind, std::string text) : kind_(kind), text_(std::move(text)) {}
  void append_line(std::string& out) const;
  void append_lines(std::string& out, std::size_t indentation, std::size_t columns, std::size_t taken) const;

  Kind kind_ = Kind::scalar;
  std::string text_ = "null";                        // serialised scalar
  std::vector<std::pair<std::string, Json>> parts_;  // elements (empty keys) or members
};

/// A number with at most `digits` significant digits; with exactly `places` decimals. Both throw std::invalid_argument for infinity and
/// NaN.
Json significant(double value, int digits);
Json decimals(double value, int places);

/// null for infinity and NaN, else format(value, digits), format being significant or decimals.
inline Json finite_or_null(double value, Json (*format)(double, int), int digits) {
  return value - value == 0.0 ? format(value, digits) : Json();
}

}  // namespace carillon::base

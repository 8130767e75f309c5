// JSON as the programs write it: a value is built, then written in one of two layouts. Members keep the order in which they were set, so
// the same values give the same bytes. document.hpp reads.
//
//   base::Json report = base::Json::object();
//   report.set("bank", path.string()).set("seconds", base::decimals(seconds, 3)).set("need_bytes", need);   // need: std::optional
//   for (const Body& body : bodies) report.member("bodies").add(body.name);
//   base::write_file(file, report.text());
//
// Thread-safe as far as separate values go; no MPI.
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

/// One value. Invariant: line() and text() are JSON (RFC 8259) as far as texts are UTF-8: numbers are finite and keys occur once.
class Json {
 public:
  Json() = default;  // null
  Json(std::same_as<bool> auto value) : text_(value ? "true" : "false") {}
  Json(std::integral auto value) requires(!std::same_as<decltype(value), bool>) : text_(std::to_string(value)) {}
  /// With as many digits as it takes to read the same number back. Throws std::invalid_argument for infinity and NaN.
  Json(double value);
  /// Written by quote() of printable.hpp.
  Json(std::string_view value);
  Json(const std::string& value) : Json(std::string_view(value)) {}
  Json(const char* value) : Json(std::string_view(value)) {}
  /// null where there is none.
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

  /// Sets a member of an object; null becomes an object first. A key that is there keeps its place. std::logic_error for other kinds.
  Json& set(std::string_view key, Json value);
  /// The member of that key, null when it is new.
  Json& member(std::string_view key);
  /// Appends to an array; null becomes an array first. std::logic_error for other kinds.
  Json& add(Json value);

  /// On one line: {"a": 1, "b": [2, 3]}, without a line break at its end.
  std::string line() const;
  /// On many: members of what does not fit into `columns` get a line each, two spaces further in; a line break at the end.
  std::string text(std::size_t columns = 120) const;

 private:
  friend Json significant(double value, int digits);
  friend Json decimals(double value, int places);
  enum class Kind { scalar, array, object };
  Json(Kind kind, std::string text) : kind_(kind), text_(std::move(text)) {}
  void append_line(std::string& out) const;
  void append_lines(std::string& out, std::size_t indentation, std::size_t columns, std::size_t taken) const;

  Kind kind_ = Kind::scalar;
  std::string text_ = "null";                        // of a scalar, as it is written
  std::vector<std::pair<std::string, Json>> parts_;  // of an array (keys are empty) or an object
};

/// A number with at most so many significant digits, and with exactly so many places behind the point. Both throw std::invalid_argument for
/// infinity and NaN.
Json significant(double value, int digits);
Json decimals(double value, int places);

/// null for infinity and NaN, else `value` as `format` (significant or decimals) writes it.
inline Json finite_or_null(double value, Json (*format)(double, int), int digits) {
  return value - value == 0.0 ? format(value, digits) : Json();
}

}  // namespace carillon::base

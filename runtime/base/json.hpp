// JSON values: built or parsed, read, and written. document.hpp reads input files with errors by line.
//
//   base::Json report = base::Json::object();
//   report.set("bank", path.string()).set("seconds", base::decimals(seconds, 3)).set("need_bytes", need);   // need: std::optional
//   for (const Body& body : bodies) report["bodies"].add(body.name);
//   base::write_file(file, report.text());
//
// Members keep their insertion order, so equal values give equal bytes. A reference to an element or a member is valid until the next
// insertion into the same array or object. Distinct values may be used in different threads; no MPI.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <ranges>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace carillon::base {

/// Options of Json::sorted_text().
struct JsonLayout {
  std::string_view indentation = "";  // empty: one line without spaces
  bool is_ascii = true;               // escapes all characters beyond ASCII; else only control characters
  bool breaks_arrays = false;         // an element per line; else only long or nested arrays are broken
};

/// JSON value. Invariant: all that it writes is valid JSON (RFC 8259) if strings are UTF-8: finite numbers, unique keys.
class Json {
 public:
  Json() = default;  // null
  Json(std::same_as<bool> auto value) : kind_(Kind::boolean), number_(value ? 1.0 : 0.0) {}
  Json(std::integral auto value) requires(!std::same_as<decltype(value), bool>) : kind_(Kind::integer), text_(std::to_string(value)) {}
  /// Throws std::invalid_argument for infinity and NaN.
  Json(double value);
  Json(std::string_view value) : kind_(Kind::string), text_(value) {}
  Json(std::string value) : kind_(Kind::string), text_(std::move(value)) {}
  Json(const char* value) : Json(std::string_view(value)) {}
  /// null if empty.
  template <class T>
  Json(const std::optional<T>& value) : Json(value ? Json(*value) : Json()) {}

  static Json object() { return Json(Kind::object, ""); }
  static Json array() { return Json(Kind::array, ""); }
  template <std::ranges::input_range Range>
  static Json array(const Range& values) {
    Json list = array();
    for (const auto& value : values) list.add(Json(value));
    return list;
  }
  /// Parses a text, which may have // and /* */ comments; of equal keys the last one counts. nullopt: not JSON, or more than 100 nested
  /// arrays and objects.
  static std::optional<Json> parse(const std::string& text);

  /// Sets a member; null becomes an object. An existing key keeps its position. std::logic_error for other kinds.
  Json& set(std::string_view key, Json value);
  /// Member by key, created as null.
  Json& operator[](std::string_view key);
  /// Appends an element; null becomes an array. std::logic_error for other kinds.
  Json& add(Json value);
  /// The same; returns the element.
  Json& append(Json value);
  Json& append();
  /// Removes a member, if present.
  void erase(std::string_view key);

  bool is_null() const { return kind_ == Kind::null; }
  bool is_number() const { return kind_ == Kind::integer || kind_ == Kind::real || kind_ == Kind::decimal; }
  bool is_real() const { return kind_ == Kind::real; }
  bool is_string() const { return kind_ == Kind::string; }
  bool is_array() const { return kind_ == Kind::array; }
  bool is_object() const { return kind_ == Kind::object; }

  /// Number of elements or members; 0 for scalars.
  std::size_t size() const { return items_.size(); }
  bool empty() const { return items_.empty(); }
  bool has(std::string_view key) const { return find(key) < items_.size(); }
  /// Member by key; null if absent.
  const Json& operator[](std::string_view key) const;
  const Json& operator[](std::size_t i) const { return items_.at(i); }
  Json& operator[](std::size_t i) { return items_.at(i); }
  /// Keys in ascending order.
  std::vector<std::string> keys() const;
  /// Elements, or values of members.
  auto begin() { return items_.begin(); }
  auto end() { return items_.end(); }
  auto begin() const { return items_.begin(); }
  auto end() const { return items_.end(); }
  /// 0 for null; std::logic_error for other kinds than numbers.
  double as_double() const;
  /// Empty for null; std::logic_error for other kinds than strings.
  const std::string& as_string() const;

  /// One line: {"a": 1, "b": [2, 3]}, no trailing newline. Numbers in the shortest form that reads back as the same number; strings are
  /// escaped by quote() of printable.hpp.
  std::string line() const;
  /// The same, indented by two spaces; values that fit into `columns` stay on one line; trailing newline.
  std::string text(std::size_t columns = 120) const;

  /// Layout of jobs, records and requests, whose bytes are compared and hashed: members by ascending key, numbers with 17 digits, no
  /// trailing newline.
  std::string sorted_text(const JsonLayout& layout = {}) const;

 private:
  friend class JsonBuilder;
  friend class SortedWriter;
  friend Json significant(double value, int digits);
  friend Json decimals(double value, int places);
  enum class Kind : std::uint8_t { null, boolean, integer, real, decimal, string, array, object };
  Json(Kind kind, std::string text) : kind_(kind), text_(std::move(text)) {}
  std::size_t find(std::string_view key) const;
  std::string format_scalar() const;
  void append_line(std::string& out) const;
  void append_lines(std::string& out, std::size_t indentation, std::size_t columns, std::size_t taken) const;

  Kind kind_ = Kind::null;
  double number_ = 0.0;            // boolean, real
  std::string text_;               // string; integer and decimal as written
  std::vector<std::string> keys_;  // object
  std::vector<Json> items_;        // array, object
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

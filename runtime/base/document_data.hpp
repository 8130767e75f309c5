// Text and values of a Document, shared by parser and views.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace carillon::base {

/// JSON value with its offset in the text; members of objects carry their key.
struct Value {
  enum class Kind : std::uint8_t { kNull, kBoolean, kNumber, kText, kList, kObject };
  std::string key{};
  std::ptrdiff_t key_offset = 0;
  Kind kind = Kind::kNull;
  bool is_true = false;
  std::optional<std::int64_t> integer{};  // for a number that is an integer in range
  double number = 0.0;
  std::ptrdiff_t offset = 0;  // position on its first line
  std::ptrdiff_t end = 0;     // array or object: past its last byte
  std::string text{};
  std::vector<Value> items{};           // array elements, or members in text order
  std::vector<std::uint32_t> by_key{};  // indices of the members, sorted by key

  bool is(Kind other) const { return kind == other; }
  /// Member of an object; nullptr if absent.
  const Value* find(std::string_view wanted) const;
};

/// Nearest double of a number of JSON; nullopt on overflow.
std::optional<double> to_double(std::string_view text);

/// Description of a value for messages: "a list of 3".
std::string kind_of(const Value& value);

/// Text, values and line table of a document.
struct DocumentData {
  std::filesystem::path file;
  int first_line = 1;
  bool has_paths = false;  // messages about an object begin with its path
  std::string text;
  Value root;
  mutable std::vector<std::size_t> line_ends;  // built on first use
  mutable std::size_t scanned_bytes = 0;       // scanned for line ends

  int line_at(std::ptrdiff_t offset) const;
  /// Throws InputError "file:line: message".
  [[noreturn]] void fail(std::ptrdiff_t offset, const std::string& message) const;
};

}  // namespace carillon::base

// The text of a Document with its tree of values, for the parser and for its views.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace carillon::base {

/// A value of JSON and where it stands in the text; of a member of an object with its key.
struct Value {
  enum class Kind : std::uint8_t { kNull, kBoolean, kNumber, kText, kList, kObject };
  std::string key{};
  std::ptrdiff_t key_offset = 0;
  Kind kind = Kind::kNull;
  bool is_true = false;
  std::optional<std::int64_t> integer{};  // of a number, if it is whole and fits
  double number = 0.0;
  std::ptrdiff_t offset = 0;  // a place on its first line
  std::ptrdiff_t end = 0;     // of a list or an object: behind its last byte
  std::string text{};
  std::vector<Value> items{};           // of a list; members of an object, in the order of the text
  std::vector<std::uint32_t> by_key{};  // numbers of the members, in the order of their keys

  bool is(Kind other) const { return kind == other; }
  /// The member of an object; nullptr when there is none.
  const Value* find(std::string_view wanted) const;
};

/// A value as part of a sentence: "a list of 3".
std::string kind_of(const Value& value);

/// The parsed text and the table of its lines, shared by all views of one document.
struct DocumentData {
  std::filesystem::path file;
  int first_line = 1;
  std::string text;
  Value root;
  mutable std::vector<std::size_t> line_ends;  // made when the first line is asked for, then searched
  mutable std::size_t scanned_bytes = 0;       // of `text`, in search of line ends

  int line_at(std::ptrdiff_t offset) const;
  /// Throws InputError "file:line: message".
  [[noreturn]] void fail(std::ptrdiff_t offset, const std::string& message) const;
};

}  // namespace carillon::base

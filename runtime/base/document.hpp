// Strict JSON documents with // comments: every value knows its file and line, every key must be asked for.
//
//   base::Document document = base::read_document("job.json");
//   base::Object job = document.root();
//   std::string mesh = job.string("mesh");                          // required
//   double nu = material.number("poisson_ratio", {-1.0, 0.5});      // required, open interval
//   double tol = solver.number_or("tolerance", 1e-8, {0.0, 1.0});   // default
//   job.finish();                                                   // an unused key is an InputError
//
// All errors are InputError: "file:line: what is wrong; what would correct it". Not thread-safe; no MPI.
#pragma once

#include <array>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// The open interval (low, high) that a number has to lie in. Finite always; bounds themselves are excluded.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};
inline constexpr Range kPositive{0.0, std::numeric_limits<double>::infinity()};

struct Value;
struct DocumentData;  // the parsed text and the line table, shared by all views of one document

struct Entry;

/// A JSON object being read. Asking for a key marks it as known.
class Object {
 public:
  bool has(std::string_view key);
  /// True when `key` is there and holds a text.
  bool has_string(std::string_view key);
  /// True when `key` is there and holds a number.
  bool has_number(std::string_view key);
  /// True when `key` is there and holds an object in braces.
  bool has_object(std::string_view key);
  /// True when `key` is there and holds a list of nothing.
  bool is_empty_list(std::string_view key);

  std::string string(std::string_view key);
  std::string string_or(std::string_view key, std::string_view fallback);
  /// One of `choices`, or an InputError that lists them.
  std::string choice(std::string_view key, const std::vector<std::string>& choices);
  std::string choice_or(std::string_view key, const std::vector<std::string>& choices, std::string_view fallback);

  double number(std::string_view key, Range range = {});
  double number_or(std::string_view key, double fallback, Range range = {});
  std::optional<double> number_if(std::string_view key, Range range = {});
  long long integer(std::string_view key, long long low, long long high);  // low <= value <= high
  std::optional<long long> integer_if(std::string_view key, long long low, long long high);
  bool boolean_or(std::string_view key, bool fallback);

  /// A list of exactly N finite numbers.
  template <std::size_t N>
  std::array<double, N> numbers(std::string_view key) {
    std::array<double, N> values{};
    copy_numbers(key, values.data(), N);
    return values;
  }
  template <std::size_t N>
  std::array<double, N> numbers_or(std::string_view key, const std::array<double, N>& fallback) {
    return has(key) ? numbers<N>(key) : fallback;
  }

  Object object(std::string_view key);
  std::optional<Object> object_if(std::string_view key);
  /// A list of objects; a missing key gives an empty list.
  std::vector<Object> objects(std::string_view key);

  /// A list of finite numbers of any length from 1 to `max`.
  std::vector<double> number_list(std::string_view key, std::size_t max);
  /// A list of lists of `columns` finite numbers each, row by row; from 1 to `max` rows.
  std::vector<std::vector<double>> number_rows(std::string_view key, std::size_t columns, std::size_t max);
  /// One text or object, or a list of at most `max` texts and objects; a missing key gives an empty list.
  std::vector<Entry> entries(std::string_view key, std::size_t max);

  /// A file named by `key`, made absolute: relative paths start at the document's folder. The file need not exist.
  std::filesystem::path path(std::string_view key);

  /// Marks `key` as known and skips whatever it holds (recorded facts that are not input).
  void ignore(std::string_view key);

  /// A document of those of the keys that are here, as they stand in the file, for another program to read: parse_document() of it with
  /// the same file and `first_line` has every value at its line.
  struct Excerpt {
    std::string text;
    int first_line = 1;
  };
  Excerpt make_excerpt(const std::vector<std::string>& keys);

  /// The keys of this object in the order of the file.
  std::vector<std::string> keys() const;

  /// Throws InputError for the first key that was never asked for, naming its line and the nearest known key.
  void finish();

  /// Throws InputError "file:line: message" at the line of `key` (of the object itself when the key is absent).
  [[noreturn]] void fail(std::string_view key, const std::string& message) const;

  /// "file:line" of `key` (of the object itself when the key is absent or empty), for messages of later.
  std::string find_place(std::string_view key) const;

  Object(std::shared_ptr<DocumentData> data, const Value* value, std::string name);

 private:
  /// The value of a required key; when it is missing, a similar unused key is named as the likely cause.
  const Value& require_value(std::string_view key);
  void copy_numbers(std::string_view key, double* values, std::size_t count);
  std::shared_ptr<DocumentData> data_;
  const Value* value_ = nullptr;  // of *data_
  std::string name_;              // dotted path, for messages
  std::shared_ptr<std::vector<std::string>> asked_;
};

/// One entry of a list that holds texts and objects.
struct Entry {
  std::string text;              // empty for an object
  std::optional<Object> object;  // none for a text
  std::string place;             // "file:line"
};

/// A parsed document.
class Document {
 public:
  Object root() const;
  const std::filesystem::path& file() const;
  /// Bytes that were read so far to find the lines of its values: never more than the text has.
  std::size_t count_scanned_bytes() const;

 private:
  friend Document parse_document(std::string_view, const std::filesystem::path&, int);
  explicit Document(std::shared_ptr<DocumentData> data);
  std::shared_ptr<DocumentData> data_;
};

/// Reads and parses a document of at most 16 MiB. Throws InputError: no such file, not a regular file, too large,
/// a syntax error (line and column), a duplicate key, a root that is no object.
Document read_document(const std::filesystem::path& file, std::string_view too_long = "check that this is the right file");

/// The same from text; `file` names it in messages and anchors relative paths, `first_line` is the number of its first line there.
Document parse_document(std::string_view text, const std::filesystem::path& file, int first_line = 1);

/// The entry of `known` with the smallest Damerau-Levenshtein distance to `word`; empty when none is within half of the word's length.
std::string find_nearest(std::string_view word, const std::vector<std::string>& known);

}  // namespace carillon::base

// Strict JSON reader with // comments: values carry file and line; unused keys are errors.
//
//   base::Document document = base::read_document("job.json");
//   base::Object job = document.root();
//   std::string mesh = job.string("mesh");                          // required
//   double nu = material.number("poisson_ratio", {-1.0, 0.5});      // required, open interval
//   double tol = solver.number_or("tolerance", 1e-8, {0.0, 1.0});   // default
//   job.finish();                                                   // an unused key is an InputError
//
// All errors are InputError "file:line: fault; remedy". Not thread-safe; no MPI.
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

/// Open interval of permitted finite numbers.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};
inline constexpr Range kPositive{0.0, std::numeric_limits<double>::infinity()};

struct Value;
struct DocumentData;  // text, values and line table, shared by all views of a document

struct Entry;

/// View of a JSON object. Requested keys are marked as known.
class Object {
 public:
  bool has(std::string_view key);
  /// True if `key` holds a string.
  bool has_string(std::string_view key);
  /// True if `key` holds a number.
  bool has_number(std::string_view key);
  /// True if `key` holds an object.
  bool has_object(std::string_view key);
  /// True if `key` holds an empty array.
  bool is_empty_list(std::string_view key);

  std::string string(std::string_view key);
  std::string string_or(std::string_view key, std::string_view fallback);
  /// One of `choices`; the InputError lists them.
  std::string choice(std::string_view key, const std::vector<std::string>& choices);
  std::string choice_or(std::string_view key, const std::vector<std::string>& choices, std::string_view fallback);

  double number(std::string_view key, Range range = {});
  double number_or(std::string_view key, double fallback, Range range = {});
  long long integer(std::string_view key, long long low, long long high);  // low <= value <= high
  std::optional<long long> integer_if(std::string_view key, long long low, long long high);
  bool boolean_or(std::string_view key, bool fallback);

  /// Array of N finite numbers.
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
  /// Array of objects; empty if the key is missing.
  std::vector<Object> objects(std::string_view key);

  /// Array of 1 to `max` finite numbers.
  std::vector<double> number_list(std::string_view key, std::size_t max);
  /// Array of 1 to `max` rows of `columns` finite numbers.
  std::vector<std::vector<double>> number_rows(std::string_view key, std::size_t columns, std::size_t max);
  /// A string or an object, or an array of at most `max` of them; empty if the key is missing.
  std::vector<Entry> entries(std::string_view key, std::size_t max);

  /// Absolute path; relative ones are resolved against the document's folder. The file need not exist.
  std::filesystem::path path(std::string_view key);

  /// Marks `key` as known without reading it (recorded facts that are not input).
  void ignore(std::string_view key);

  /// A document with those of `keys` that are present, as in the file, for another program: parse_document() with the same file and
  /// `first_line` reproduces the line numbers.
  struct Excerpt {
    std::string text;
    int first_line = 1;
  };
  Excerpt make_excerpt(const std::vector<std::string>& keys);

  /// Keys in file order.
  std::vector<std::string> keys() const;

  /// Throws InputError for the first unused key, with its line and the nearest known key.
  void finish();

  /// Throws InputError "file:line: message" at `key` (at the object if the key is absent).
  [[noreturn]] void fail(std::string_view key, const std::string& message) const;

  /// "file:line" of `key` (of the object if the key is absent or empty), for later messages.
  std::string find_place(std::string_view key) const;

  Object(std::shared_ptr<DocumentData> data, const Value* value, std::string name);

 private:
  /// Value of a required key; if missing, the message suggests a similar unused key.
  const Value& require_value(std::string_view key);
  void copy_numbers(std::string_view key, double* values, std::size_t count);
  std::shared_ptr<DocumentData> data_;
  const Value* value_ = nullptr;  // in *data_
  std::string name_;              // dotted path, for messages
  std::shared_ptr<std::vector<std::string>> asked_;
};

/// Entry of an array of strings and objects.
struct Entry {
  std::string text;              // empty for an object
  std::optional<Object> object;  // nullopt for a string
  std::string place;             // "file:line"
};

/// A parsed document.
class Document {
 public:
  Object root() const;
  /// From now on messages about an object as a whole begin with its path, as those about a key do: for files without lines.
  void show_paths();
  const std::filesystem::path& file() const;
  /// Bytes scanned so far for line numbers; at most the length of the text.
  std::size_t count_scanned_bytes() const;

 private:
  friend Document parse_document(std::string_view, const std::filesystem::path&, int);
  explicit Document(std::shared_ptr<DocumentData> data);
  std::shared_ptr<DocumentData> data_;
};

/// Parses a file of at most 16 MiB. Throws InputError: missing, not a regular file, too large, syntax error (line and column), duplicate
/// key, root not an object.
Document read_document(const std::filesystem::path& file, std::string_view too_long = "check that this is the right file");

/// Parses text. `file` appears in messages and anchors relative paths; `first_line` numbers the first line.
Document parse_document(std::string_view text, const std::filesystem::path& file, int first_line = 1);

/// Entry of `known` with the smallest Damerau-Levenshtein distance to `word`; empty if above half of the word's length.
std::string find_nearest(std::string_view word, const std::vector<std::string>& known);

}  // namespace carillon::base

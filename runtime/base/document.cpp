// One text and all that is asked of it, by one tree of values; longer than most files.
// Method: RapidJSON reads the text event by event; every value and every key is kept with the offset of its place, from which lines are
// counted. Each Object remembers the keys that it was asked for, so the set of known keys is the set that the reading code really uses and
// cannot drift from it.
#include "runtime/base/document.hpp"

#include <fmt/core.h>
#include <rapidjson/error/en.h>
#include <rapidjson/reader.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/foreign.hpp"

namespace carillon::base {
namespace {

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

const Value* Value::find(std::string_view wanted) const {
  const auto at = std::lower_bound(by_key.begin(), by_key.end(), wanted,
                                   [this](std::uint32_t i, std::string_view other) { return items[i].key < other; });
  return at != by_key.end() && items[*at].key == wanted ? &items[*at] : nullptr;
}

}  // namespace

struct DocumentData {
  std::filesystem::path file;
  int first_line = 1;
  std::string text;
  Value root;
  mutable std::vector<std::size_t> line_ends;  // made when the first line is asked for, then searched
  mutable std::size_t scanned_bytes = 0;       // of `text`, in search of line ends

  int line_at(std::ptrdiff_t offset) const {
    if (scanned_bytes == 0) {
      scanned_bytes = text.size();
      for (std::size_t at = text.find('\n'); at != std::string::npos; at = text.find('\n', at + 1)) line_ends.push_back(at);
    }
    const auto end = static_cast<std::size_t>(std::max<std::ptrdiff_t>(offset, 0));
    return first_line + static_cast<int>(std::lower_bound(line_ends.begin(), line_ends.end(), end) - line_ends.begin());
  }
  [[noreturn]] void fail(std::ptrdiff_t offset, const std::string& message) const {
    throw PlacedError(fmt::format("{}:{}", file.string(), line_at(offset)), message);
  }
};

namespace {

constexpr std::uint64_t kMaxBytes = 16u << 20;
constexpr int kMaxDepth = 100;

const Value& json(const void* value) { return *static_cast<const Value*>(value); }

std::string kind_of(const Value& value) {
  switch (value.kind) {
    case Value::Kind::kNull:
      return "null";
    case Value::Kind::kBoolean:
      return value.is_true ? "true" : "false";
    case Value::Kind::kText:
      return fmt::format("the text \"{}\"", value.text.substr(0, 60));
    case Value::Kind::kList:
      return fmt::format("a list of {}", value.items.size());
    case Value::Kind::kObject:
      return "an object";
    case Value::Kind::kNumber:
      break;
  }
  return value.integer ? fmt::format("the number {}", *value.integer) : fmt::format("the number {}", value.number);
}

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "\"" : ", \"") + word + "\"";
  return text;
}

/// The double that is nearest to a number of JSON; nothing when it is too large. By the standard library: RapidJSON's own conversion counts
/// the leading zeros of 0, which is undefined.
std::optional<double> to_double(std::string_view text) {
#ifdef __cpp_lib_to_chars
  double number = 0.0;
  auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc::result_out_of_range) {
    // Too large or too small: a long double decides. Beyond that as well, it is small if its exponent is negative or its whole part 0,
    // since RapidJSON takes no exponent above 308.
    long double wide = 0.0L;
    const bool is_within = std::from_chars(text.data(), text.data() + text.size(), wide).ec == std::errc();
    if (!is_within && text.find('-', 1) == std::string_view::npos && text.substr(text.starts_with('-') ? 1 : 0, 1) != "0")
      return std::nullopt;
    number = static_cast<double>(wide);
    error = std::errc();
  }
  if (error != std::errc()) return std::nullopt;
#else
  const double number = std::strtod(std::string(text).c_str(), nullptr);  // WebAssembly, where there is but one locale
#endif
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

/// Makes Values of the events of a rapidjson::Reader.
class Builder {
 public:
  Builder(const DocumentData& data, const rapidjson::StringStream& stream, Value& root) : data_(&data), stream_(&stream), open_{&root} {}

  bool Null() { return add({}); }
  bool Bool(bool is_true) { return add({.kind = Value::Kind::kBoolean, .is_true = is_true}); }
  bool RawNumber(const char* text, rapidjson::SizeType size, bool) { return add_number({text, size}); }
  // Numbers come as text.
  bool Int(int) { return false; }
  bool Uint(unsigned) { return false; }
  bool Int64(std::int64_t) { return false; }
  bool Uint64(std::uint64_t) { return false; }
  bool Double(double) { return false; }
  bool String(const char* text, rapidjson::SizeType size, bool) {
    return add({.kind = Value::Kind::kText, .text = std::string(text, size)});
  }
  bool Key(const char* text, rapidjson::SizeType size, bool) {
    open_.back()->items.push_back({.key = std::string(text, size), .key_offset = get_offset()});
    return true;
  }
  bool StartObject() { return add({.kind = Value::Kind::kObject}); }
  bool StartArray() { return add({.kind = Value::Kind::kList}); }
  bool EndArray(rapidjson::SizeType) { return close(); }
  bool EndObject(rapidjson::SizeType) {
    Value& object = *open_.back();
    object.by_key.resize(object.items.size());
    std::iota(object.by_key.begin(), object.by_key.end(), 0U);
    std::stable_sort(object.by_key.begin(), object.by_key.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return object.items[a].key < object.items[b].key; });
    const auto twice = std::adjacent_find(object.by_key.begin(), object.by_key.end(),
                                          [&](std::uint32_t a, std::uint32_t b) { return object.items[a].key == object.items[b].key; });
    if (twice != object.by_key.end()) {
      const Value& second = object.items[*(twice + 1)];
      data_->fail(second.key_offset, fmt::format("the key \"{}\" is there twice; leave one of them", second.key.substr(0, 80)));
    }
    return close();
  }

 private:
  /// Somewhere from the beginning of what was read last to the byte behind it: that a token lies on one line is what counts.
  std::ptrdiff_t get_offset() const { return stream_->src_ - stream_->head_; }
  bool add_number(std::string_view text) {
    std::int64_t integer = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), integer);
    if (error == std::errc() && end == text.data() + text.size())
      return add({.kind = Value::Kind::kNumber, .integer = integer, .number = static_cast<double>(integer)});
    const std::optional<double> number = to_double(text);
    if (!number) data_->fail(get_offset(), fmt::format("this is not JSON: the number {} is too large; correct it", text.substr(0, 40)));
    constexpr double kBeyond = 9223372036854775808.0;  // 2^63
    const bool is_whole = *number == std::floor(*number) && *number >= -kBeyond && *number < kBeyond;
    return add({.kind = Value::Kind::kNumber,
                .integer = is_whole ? std::optional(static_cast<std::int64_t>(*number)) : std::nullopt,
                .number = *number});
  }
  bool add(Value value) {
    value.offset = get_offset();
    Value& into = *open_.back();
    Value* place = &into;  // the root
    if (is_root_there_) place = into.is(Value::Kind::kList) ? &into.items.emplace_back() : &into.items.back();
    value.key = std::move(place->key);
    value.key_offset = place->key_offset;
    *place = std::move(value);
    if (place->is(Value::Kind::kList) || place->is(Value::Kind::kObject)) {
      if (is_root_there_) open_.push_back(place);
    }
    is_root_there_ = true;
    return true;
  }
  bool close() {
    open_.back()->end = get_offset();
    if (open_.size() > 1) open_.pop_back();
    return true;
  }

  const DocumentData* data_;
  const rapidjson::StringStream* stream_;
  std::vector<Value*> open_;  // containers, the root first; only the last one grows, so that they stay where they are
  bool is_root_there_ = false;
};

[[noreturn]] void fail_syntax(const DocumentData& data, const rapidjson::ParseResult& result) {
  const std::size_t at = std::min(result.Offset(), data.text.size());
  const std::size_t line_begin = at == 0 ? 0 : data.text.rfind('\n', at - 1) + 1;
  std::string reason = rapidjson::GetParseError_En(result.Code());
  if (reason.ends_with('.')) reason.pop_back();
  if (!reason.empty()) reason[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(reason[0])));
  data.fail(static_cast<std::ptrdiff_t>(at), fmt::format("this is not JSON (column {}): {}; {}", at - line_begin + 1, reason,
                                                         result.Code() == rapidjson::kParseErrorStringEscapeInvalid
                                                             ? "use / between the folders of a path, and write any other backslash twice"
                                                             : "correct the text there"));
}

/// What is wrong with a word that begins like a number, as part of a sentence; nullptr when it is one by the grammar of JSON.
const char* find_number_fault(std::string_view word) {
  const auto skip_digits = [&] {
    const std::size_t digits = std::min(word.find_first_not_of("0123456789"), word.size());
    word.remove_prefix(digits);
    return digits;
  };
  const bool is_signed = word.starts_with('-');
  if (word.starts_with('+')) return "a number has no plus sign; leave it away";
  if (is_signed) word.remove_prefix(1);
  const bool has_zero = word.starts_with('0');
  const std::size_t whole = skip_digits();
  if (whole == 0) {
    if (word.starts_with('.')) return "there has to be a digit before the point: 0.5, not .5";
    return is_signed ? "a minus sign is followed by digits" : "this is no number";
  }
  if (has_zero && whole > 1) return "a number does not begin with a zero (12, not 012); a point may be missing behind it";
  if (has_zero && (word.starts_with('x') || word.starts_with('X') || word.starts_with('b') || word.starts_with('o')))
    return "numbers are decimal here";
  if (word.starts_with('.')) {
    word.remove_prefix(1);
    if (skip_digits() == 0) return "there has to be a digit behind the point: 1.0 or 1, not 1.";
  }
  if (word.starts_with('e') || word.starts_with('E')) {
    word.remove_prefix(1);
    if (word.starts_with('+') || word.starts_with('-')) word.remove_prefix(1);
    if (skip_digits() == 0) return "there has to be a whole number behind the e of a power of ten";
  }
  return word.empty() ? nullptr : "there is something behind the number; separate values by commas, and give units no letters";
}

/// What comes before the parser: the depth of brackets outside strings and comments, so that the parser's recursion is bounded before it
/// starts, and the form of numbers, with a better word than it has.
void check_text(const DocumentData& data) {
  constexpr std::string_view kWord = "0123456789+-._abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
  const std::string_view text = data.text;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\')
        ++i;
      else if (c == '"')
        in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (text.substr(i, 2) == "//") {
      while (i < text.size() && text[i] != '\n') ++i;
    } else if (text.substr(i, 2) == "/*") {
      i = std::min(text.find("*/", i + 2), text.size());
      ++i;  // on the slash
    } else if (kWord.find(c) != std::string_view::npos) {
      const std::string_view word = text.substr(i, text.find_first_not_of(kWord, i) - i);
      const char* const fault = std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_' ? nullptr : find_number_fault(word);
      if (fault != nullptr)
        data.fail(static_cast<std::ptrdiff_t>(i),
                  fmt::format("{}{} is not a number as JSON writes it: {}", word.substr(0, 40), word.size() > 40 ? "..." : "", fault));
      i += word.size() - 1;
    } else if (c == '{' || c == '[') {
      if (++depth > kMaxDepth)
        data.fail(static_cast<std::ptrdiff_t>(i), fmt::format("more than {} brackets inside one another; flatten this", kMaxDepth));
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
}

}  // namespace

Document::Document(std::shared_ptr<DocumentData> data) : data_(std::move(data)) {}
Object Document::root() const { return Object(data_, &data_->root, ""); }
const std::filesystem::path& Document::file() const { return data_->file; }
std::size_t Document::count_scanned_bytes() const { return data_->scanned_bytes; }

Document read_document(const std::filesystem::path& file, std::string_view too_long) {
  return parse_document(read_file(file, "JSON file", kMaxBytes, too_long), file);
}

Document parse_document(std::string_view text, const std::filesystem::path& file, int first_line) {
  auto data = std::make_shared<DocumentData>();
  data->file = file;
  data->first_line = first_line;
  refuse_utf16(text, file.string());
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);  // UTF-8 byte order mark
  data->text = std::string(text);
  if (const std::size_t at = text.find('\0'); at != std::string_view::npos) {
    const auto line = first_line + static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
    throw PlacedError(fmt::format("{}:{}", file.string(), line),
                      "there is a zero byte, which no text has; check that this is the right file");
  }
  check_text(*data);
  rapidjson::StringStream stream(data->text.c_str());
  Builder builder(*data, stream, data->root);
  rapidjson::Reader reader;
  const rapidjson::ParseResult result =
      reader.Parse<rapidjson::kParseNumbersAsStringsFlag | rapidjson::kParseCommentsFlag>(stream, builder);
  if (result.IsError()) fail_syntax(*data, result);
  if (!data->root.is(Value::Kind::kObject))
    throw InputError(
        fmt::format("{}:{}: the file must hold one JSON object in braces, and holds {}", file.string(), first_line, kind_of(data->root)));
  return Document(std::move(data));
}

Object::Object(std::shared_ptr<DocumentData> data, const void* value, std::string name)
    : data_(std::move(data)), value_(value), name_(std::move(name)), asked_(std::make_shared<std::vector<std::string>>()) {}

bool Object::has(std::string_view key) {
  if (std::find(asked_->begin(), asked_->end(), key) == asked_->end()) asked_->emplace_back(key);
  return json(value_).find(key) != nullptr;
}

bool Object::has_string(std::string_view key) { return has(key) && json(value_).find(key)->is(Value::Kind::kText); }
bool Object::has_number(std::string_view key) { return has(key) && json(value_).find(key)->is(Value::Kind::kNumber); }
bool Object::has_object(std::string_view key) { return has(key) && json(value_).find(key)->is(Value::Kind::kObject); }
bool Object::is_empty_list(std::string_view key) {
  return has(key) && json(value_).find(key)->is(Value::Kind::kList) && json(value_).find(key)->items.empty();
}

namespace {

std::string full_name(const std::string& name, std::string_view key) {
  const std::string_view shown = key.substr(0, 80);  // a hostile key must not flood the terminal
  return name.empty() ? std::string(shown) : fmt::format("{}.{}", name, shown);
}

}  // namespace

void Object::fail(std::string_view key, const std::string& message) const {
  const Value* member = key.empty() ? nullptr : json(value_).find(key);
  if (member != nullptr) data_->fail(member->key_offset, fmt::format("\"{}\": {}", full_name(name_, key), message));
  data_->fail(json(value_).offset, key.empty() ? message : fmt::format("\"{}\": {}", full_name(name_, key), message));
}

namespace {

/// Damerau-Levenshtein distance (adjacent swaps count one), three rows.
std::size_t calc_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) row[j] = std::min(row[j], before[j - 2] + 1);
    }
    std::swap(before, last);
    std::swap(last, row);
  }
  return last[b.size()];
}

/// The key of `present` that `wanted` was probably meant to be: within a quarter of its length, or one name containing the other.
std::string find_misspelt(std::string_view wanted, const std::vector<std::string>& present, const std::vector<std::string>& known) {
  for (const std::string& key : present) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    const bool contained = key.find(wanted) != std::string::npos || (key.size() > 3 && wanted.find(key) != std::string_view::npos);
    if (contained || (key.size() <= 200 && calc_distance(wanted, key) <= std::max<std::size_t>(1, wanted.size() / 4))) return key;
  }
  return "";
}

double to_number(const Object& object, const Value& value, std::string_view key, Range range) {
  if (!value.is(Value::Kind::kNumber)) object.fail(key, fmt::format("must be a number, and is {}", kind_of(value)));
  const double number = value.number;
  if (!std::isfinite(number)) object.fail(key, "must be a finite number");
  if (!(number > range.low && number < range.high)) {
    if (range.low == 0.0 && std::isinf(range.high)) object.fail(key, fmt::format("must be greater than 0, and is {}", number));
    object.fail(key, fmt::format("must lie between {} and {} (both excluded), and is {}", range.low, range.high, number));
  }
  return number;
}

}  // namespace

const void* Object::require_value(std::string_view key) {
  if (!has(key)) {
    const std::string near = find_misspelt(key, keys(), *asked_);
    fail(near, near.empty() ? fmt::format("\"{}\" is missing here; add it", key)
                            : fmt::format("unknown key; \"{}\" is required here: did you mean \"{}\"?", key, key));
  }
  return json(value_).find(key);
}

std::string Object::string(std::string_view key) {
  const Value& value = json(require_value(key));
  if (!value.is(Value::Kind::kText)) fail(key, fmt::format("must be a text in quotes, and is {}", kind_of(value)));
  if (value.text.empty()) fail(key, "must not be empty");
  if (value.text.find('\0') != std::string::npos) fail(key, "must not hold a zero byte");
  return value.text;
}

std::string Object::string_or(std::string_view key, std::string_view fallback) { return has(key) ? string(key) : std::string(fallback); }

std::string Object::choice(std::string_view key, const std::vector<std::string>& choices) {
  std::string word = string(key);
  if (std::find(choices.begin(), choices.end(), word) != choices.end()) return word;
  const std::string near = find_nearest(word, choices);
  fail(key, fmt::format("\"{}\" is none of {}{}", word, join(choices), near.empty() ? "" : fmt::format("; did you mean \"{}\"?", near)));
}

std::string Object::choice_or(std::string_view key, const std::vector<std::string>& choices, std::string_view fallback) {
  return has(key) ? choice(key, choices) : std::string(fallback);
}

double Object::number(std::string_view key, Range range) { return to_number(*this, json(require_value(key)), key, range); }
double Object::number_or(std::string_view key, double fallback, Range range) { return has(key) ? number(key, range) : fallback; }
std::optional<double> Object::number_if(std::string_view key, Range range) {
  return has(key) ? std::optional(number(key, range)) : std::nullopt;
}

long long Object::integer(std::string_view key, long long low, long long high) {
  const Value& value = json(require_value(key));
  if (!value.integer) fail(key, fmt::format("must be a whole number, and is {}", kind_of(value)));
  const long long number = *value.integer;
  if (number < low || number > high) fail(key, fmt::format("must be from {} to {}, and is {}", low, high, number));
  return number;
}

std::optional<long long> Object::integer_if(std::string_view key, long long low, long long high) {
  return has(key) ? std::optional(integer(key, low, high)) : std::nullopt;
}

bool Object::boolean_or(std::string_view key, bool fallback) {
  if (!has(key)) return fallback;
  const Value& value = *json(value_).find(key);
  if (!value.is(Value::Kind::kBoolean)) fail(key, fmt::format("must be true or false, and is {}", kind_of(value)));
  return value.is_true;
}

void Object::copy_numbers(std::string_view key, double* values, std::size_t count) {
  const Value& list = json(require_value(key));
  if (!list.is(Value::Kind::kList) || list.items.size() != count)
    fail(key, fmt::format("must be a list of {} numbers, and is {}", count, kind_of(list)));
  for (std::size_t i = 0; i < count; ++i) values[i] = to_number(*this, list.items[i], key, {});
}

std::vector<double> Object::number_list(std::string_view key, std::size_t max) {
  const Value& list = json(require_value(key));
  if (!list.is(Value::Kind::kList) || list.items.empty() || list.items.size() > max)
    fail(key, fmt::format("must be a list of 1 to {} numbers, and is {}", max, kind_of(list)));
  std::vector<double> values(list.items.size());
  copy_numbers(key, values.data(), values.size());
  return values;
}

std::vector<std::vector<double>> Object::number_rows(std::string_view key, std::size_t columns, std::size_t max) {
  const Value& list = json(require_value(key));
  if (!list.is(Value::Kind::kList) || list.items.empty() || list.items.size() > max)
    fail(key, fmt::format("must be a list of 1 to {} lists of {} numbers, and is {}", max, columns, kind_of(list)));
  std::vector<std::vector<double>> rows;
  for (std::size_t i = 0; i < list.items.size(); ++i) {
    const Value& entry = list.items[i];
    if (!entry.is(Value::Kind::kList) || entry.items.size() != columns)
      fail(key, fmt::format("entry {} must be a list of {} numbers, and is {}", i, columns, kind_of(entry)));
    std::vector<double>& row = rows.emplace_back();
    for (const Value& value : entry.items) row.push_back(to_number(*this, value, key, {}));
  }
  return rows;
}

std::vector<Entry> Object::entries(std::string_view key, std::size_t max) {
  if (!has(key)) return {};
  const Value& value = *json(value_).find(key);
  std::vector<Entry> list;
  const auto add = [&](const Value& entry, const std::string& name) {
    const std::string place = fmt::format("{}:{}", data_->file.string(), data_->line_at(entry.offset));
    if (entry.is(Value::Kind::kText) && !entry.text.empty() && entry.text.find('\0') == std::string::npos)
      list.push_back({entry.text, {}, place});
    else if (entry.is(Value::Kind::kObject))
      list.push_back({"", Object(data_, &entry, name), place});
    else
      fail(key, fmt::format("must be a text or an object, or a list of them, and holds {}", kind_of(entry)));
  };
  if (!value.is(Value::Kind::kList)) {
    add(value, full_name(name_, key));
    return list;
  }
  if (value.items.size() > max) fail(key, fmt::format("must have at most {} entries, and has {}", max, value.items.size()));
  for (std::size_t i = 0; i < value.items.size(); ++i) add(value.items[i], fmt::format("{}[{}]", full_name(name_, key), i));
  return list;
}

std::string Object::find_place(std::string_view key) const {
  const Value* member = key.empty() ? nullptr : json(value_).find(key);
  return fmt::format("{}:{}", data_->file.string(), data_->line_at(member != nullptr ? member->key_offset : json(value_).offset));
}

Object Object::object(std::string_view key) {
  const Value& value = json(require_value(key));
  if (!value.is(Value::Kind::kObject)) fail(key, fmt::format("must be an object in braces, and is {}", kind_of(value)));
  return Object(data_, &value, full_name(name_, key));
}

std::optional<Object> Object::object_if(std::string_view key) { return has(key) ? std::optional(object(key)) : std::nullopt; }

std::vector<Object> Object::objects(std::string_view key) {
  std::vector<Object> list;
  if (!has(key)) return list;
  const Value& value = *json(value_).find(key);
  if (!value.is(Value::Kind::kList)) fail(key, fmt::format("must be a list in square brackets, and is {}", kind_of(value)));
  for (std::size_t i = 0; i < value.items.size(); ++i) {
    const Value& entry = value.items[i];
    if (!entry.is(Value::Kind::kObject)) fail(key, fmt::format("entry {} must be an object in braces, and is {}", i, kind_of(entry)));
    list.emplace_back(data_, &entry, fmt::format("{}[{}]", full_name(name_, key), i));
  }
  return list;
}

std::filesystem::path Object::path(std::string_view key) {
  const std::filesystem::path named = string(key);
  std::error_code error;
  if (const std::string hint = hint_backslash(named); !hint.empty() && !std::filesystem::exists(data_->file.parent_path() / named, error))
    fail(key, fmt::format("there is no file \"{}\"{}", named.string(), hint));
  return std::filesystem::absolute(named.is_absolute() ? named : data_->file.parent_path() / named).lexically_normal();
}

void Object::ignore(std::string_view key) { has(key); }

namespace {

/// The first byte from `at` on that is neither white space nor part of a comment; the text was parsed before.
std::size_t skip_space(std::string_view text, std::size_t at) {
  while (at < text.size()) {
    if (std::string_view(" \t\r\n").find(text[at]) != std::string_view::npos)
      ++at;
    else if (text.substr(at, 2) == "//")
      at = std::min(text.find('\n', at), text.size());
    else if (text.substr(at, 2) == "/*")
      at = std::min(text.find("*/", at + 2), text.size() - 2) + 2;
    else
      break;
  }
  return at;
}

/// The byte behind the text in quotes that begins at `at`.
std::size_t skip_quoted(std::string_view text, std::size_t at) {
  for (++at; at < text.size() && text[at] != '"'; ++at)
    if (text[at] == '\\') ++at;
  return at + 1;
}

/// The byte behind the value that begins at `at`.
std::size_t find_end(std::string_view text, std::size_t at, const Value& value) {
  if (value.is(Value::Kind::kList) || value.is(Value::Kind::kObject)) return static_cast<std::size_t>(value.end);
  if (value.is(Value::Kind::kText)) return skip_quoted(text, at);
  return std::min(text.find_first_of(" \t\r\n,]}/", at), text.size());
}

}  // namespace

Object::Excerpt Object::make_excerpt(const std::vector<std::string>& keys) {
  std::vector<const Value*> found;
  for (const std::string& key : keys)
    if (has(key)) found.push_back(json(value_).find(key));
  std::sort(found.begin(), found.end(), [](const Value* a, const Value* b) { return a->key_offset < b->key_offset; });
  Excerpt excerpt{.text = "{", .first_line = found.empty() ? 1 : data_->line_at(found[0]->key_offset)};
  int line = excerpt.first_line;
  for (const Value* member : found) {
    if (member != found[0]) excerpt.text += ", ";
    for (; line < data_->line_at(member->key_offset); ++line) excerpt.text += '\n';
    excerpt.text += fmt::format("\"{}\": ", member->key);
    const std::size_t colon = skip_space(data_->text, skip_quoted(data_->text, static_cast<std::size_t>(member->key_offset)));
    const std::size_t begin = skip_space(data_->text, colon + 1);
    for (; line < data_->line_at(static_cast<std::ptrdiff_t>(begin)); ++line) excerpt.text += '\n';
    const std::string own = data_->text.substr(begin, find_end(data_->text, begin, *member) - begin);
    line += static_cast<int>(std::count(own.begin(), own.end(), '\n'));
    excerpt.text += own;
  }
  excerpt.text += "}\n";
  return excerpt;
}

std::vector<std::string> Object::keys() const {
  std::vector<std::string> names;
  for (const Value& member : json(value_).items) names.push_back(member.key);
  return names;
}

void Object::finish() {
  // A key that is not there yet is likelier meant than one that is: alpha2_s next to alpha1_s is alpha2_per_s.
  std::vector<std::string> open;
  for (const std::string& key : *asked_)
    if (json(value_).find(key) == nullptr) open.push_back(key);
  for (const std::string& key : keys()) {
    if (std::find(asked_->begin(), asked_->end(), key) != asked_->end()) continue;
    std::string near = find_nearest(key, open);
    if (near.empty()) near = find_nearest(key, *asked_);
    fail(key,
         near.empty() ? fmt::format("unknown key; known here: {}", join(*asked_)) : fmt::format("unknown key; did you mean \"{}\"?", near));
  }
}

std::string find_nearest(std::string_view word, const std::vector<std::string>& known) {
  std::string nearest;
  std::size_t best = word.size() / 2 + 1;
  if (word.size() > 200) return nearest;
  for (const std::string& candidate : known) {
    const std::size_t distance = calc_distance(word, candidate);
    if (distance < best) {
      best = distance;
      nearest = candidate;
    }
  }
  if (!nearest.empty()) return nearest;
  for (const std::string& candidate : known) {  // "box" for "box_m", "modes" for "max_modes"
    const bool contained = word.size() >= 3 && candidate.find(word) != std::string::npos;
    if (contained || (candidate.size() >= 4 && word.find(candidate) != std::string_view::npos)) return candidate;
  }
  return nearest;
}

}  // namespace carillon::base

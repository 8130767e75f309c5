// Method: jsoncpp parses and keeps the byte offset of every value; lines are counted from those offsets. Each Object remembers the keys
// that it was asked for, so the set of known keys is the set that the reading code really uses and cannot drift from it.
#include "runtime/base/document.hpp"

#include <fmt/core.h>
#include <json/json.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>

#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"

namespace carillon::base {

struct DocumentData {
  std::filesystem::path file;
  int first_line = 1;
  std::string text;
  Json::Value root;
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

const Json::Value& json(const void* value) { return *static_cast<const Json::Value*>(value); }

std::string kind_of(const Json::Value& value) {
  switch (value.type()) {
    case Json::nullValue:
      return "null";
    case Json::booleanValue:
      return value.asBool() ? "true" : "false";
    case Json::stringValue:
      return fmt::format("the text \"{}\"", value.asString().substr(0, 60));
    case Json::arrayValue:
      return fmt::format("a list of {}", value.size());
    case Json::objectValue:
      return "an object";
    default:
      return fmt::format("the number {}", value.asString());
  }
}

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "\"" : ", \"") + word + "\"";
  return text;
}

/// jsoncpp keeps no offset for a key: it is the last place before the value where the quoted key stands.
std::ptrdiff_t find_key_offset(const DocumentData& data, const Json::Value& value, std::string_view key) {
  const auto at = data.text.rfind(fmt::format("\"{}\"", key), static_cast<std::size_t>(value.getOffsetStart()));
  return at == std::string::npos ? value.getOffsetStart() : static_cast<std::ptrdiff_t>(at);
}

/// Turns jsoncpp's report ("* Line 3, Column 5\n  Missing ',' ...") into "file:3: ...".
[[noreturn]] void fail_syntax(const DocumentData& data, const std::string& report) {
  int line = 1;
  int column = 1;
  std::string reason = report;
  if (std::sscanf(report.c_str(), "* Line %d, Column %d", &line, &column) == 2) {
    const auto start = std::min(report.find('\n'), report.size());
    reason = report.substr(start, report.find('\n', start + 1) - start);
  }
  reason.erase(0, reason.find_first_not_of(" \n"));
  throw PlacedError(fmt::format("{}:{}", data.file.string(), line - 1 + data.first_line),
                    fmt::format("this is not JSON (column {}): {}; correct the text there", column, reason.substr(0, 200)));
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

/// What jsoncpp is too lenient with: the depth of brackets outside strings and comments, so that the parser's recursion is bounded before
/// it starts, and the form of numbers.
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
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);  // UTF-8 byte order mark
  data->text = std::string(text);
  if (const std::size_t at = text.find('\0'); at != std::string_view::npos) {
    const auto line = first_line + static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
    throw PlacedError(fmt::format("{}:{}", file.string(), line),
                      "there is a zero byte, which no text has; check that this is the right file");
  }
  check_text(*data);
  Json::CharReaderBuilder builder;
  Json::CharReaderBuilder::strictMode(&builder.settings_);
  builder["allowComments"] = true;
  builder["collectComments"] = false;
  builder["rejectDupKeys"] = true;
  builder["stackLimit"] = kMaxDepth + 2;
  const std::unique_ptr<Json::CharReader> reader(builder.newCharReader());
  std::string report;
  try {
    if (!reader->parse(data->text.data(), data->text.data() + data->text.size(), &data->root, &report)) fail_syntax(*data, report);
  } catch (const Json::Exception& error) {
    throw PlacedError(fmt::format("{}:{}", file.string(), first_line), fmt::format("this is not JSON: {}; correct the text", error.what()));
  }
  if (!data->root.isObject())
    throw InputError(
        fmt::format("{}:{}: the file must hold one JSON object in braces, and holds {}", file.string(), first_line, kind_of(data->root)));
  return Document(std::move(data));
}

Object::Object(std::shared_ptr<DocumentData> data, const void* value, std::string name)
    : data_(std::move(data)), value_(value), name_(std::move(name)), asked_(std::make_shared<std::vector<std::string>>()) {}

bool Object::has(std::string_view key) {
  if (std::find(asked_->begin(), asked_->end(), key) == asked_->end()) asked_->emplace_back(key);
  return json(value_).isMember(std::string(key));
}

bool Object::has_string(std::string_view key) { return has(key) && json(value_)[std::string(key)].isString(); }
bool Object::has_number(std::string_view key) { return has(key) && json(value_)[std::string(key)].isNumeric(); }
bool Object::is_empty_list(std::string_view key) {
  return has(key) && json(value_)[std::string(key)].isArray() && json(value_)[std::string(key)].empty();
}
bool Object::has_object(std::string_view key) { return has(key) && json(value_)[std::string(key)].isObject(); }

namespace {

std::string full_name(const std::string& name, std::string_view key) {
  const std::string_view shown = key.substr(0, 80);  // a hostile key must not flood the terminal
  return name.empty() ? std::string(shown) : fmt::format("{}.{}", name, shown);
}

}  // namespace

void Object::fail(std::string_view key, const std::string& message) const {
  const Json::Value& object = json(value_);
  if (!key.empty() && object.isMember(std::string(key))) {
    data_->fail(find_key_offset(*data_, object[std::string(key)], key), fmt::format("\"{}\": {}", full_name(name_, key), message));
  }
  data_->fail(object.getOffsetStart(), key.empty() ? message : fmt::format("\"{}\": {}", full_name(name_, key), message));
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

double to_number(const Object& object, const Json::Value& value, std::string_view key, Range range) {
  if (!value.isNumeric()) object.fail(key, fmt::format("must be a number, and is {}", kind_of(value)));
  const double number = value.asDouble();
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
  return &json(value_)[std::string(key)];
}

std::string Object::string(std::string_view key) {
  const Json::Value& value = json(require_value(key));
  if (!value.isString()) fail(key, fmt::format("must be a text in quotes, and is {}", kind_of(value)));
  if (value.asString().empty()) fail(key, "must not be empty");
  if (value.asString().find('\0') != std::string::npos) fail(key, "must not hold a zero byte");
  return value.asString();
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
  const Json::Value& value = json(require_value(key));
  if (!value.isInt64()) fail(key, fmt::format("must be a whole number, and is {}", kind_of(value)));
  const long long number = value.asInt64();
  if (number < low || number > high) fail(key, fmt::format("must be from {} to {}, and is {}", low, high, number));
  return number;
}

std::optional<long long> Object::integer_if(std::string_view key, long long low, long long high) {
  return has(key) ? std::optional(integer(key, low, high)) : std::nullopt;
}

bool Object::boolean_or(std::string_view key, bool fallback) {
  if (!has(key)) return fallback;
  const Json::Value& value = json(value_)[std::string(key)];
  if (!value.isBool()) fail(key, fmt::format("must be true or false, and is {}", kind_of(value)));
  return value.asBool();
}

void Object::copy_numbers(std::string_view key, double* values, std::size_t count) {
  const Json::Value& list = json(require_value(key));
  if (!list.isArray() || list.size() != count) fail(key, fmt::format("must be a list of {} numbers, and is {}", count, kind_of(list)));
  for (std::size_t i = 0; i < count; ++i) values[i] = to_number(*this, list[static_cast<Json::ArrayIndex>(i)], key, {});
}

std::vector<double> Object::number_list(std::string_view key, std::size_t max) {
  const Json::Value& list = json(require_value(key));
  if (!list.isArray() || list.empty() || list.size() > max)
    fail(key, fmt::format("must be a list of 1 to {} numbers, and is {}", max, kind_of(list)));
  std::vector<double> values(list.size());
  copy_numbers(key, values.data(), values.size());
  return values;
}

std::vector<std::vector<double>> Object::number_rows(std::string_view key, std::size_t columns, std::size_t max) {
  const Json::Value& list = json(require_value(key));
  if (!list.isArray() || list.empty() || list.size() > max)
    fail(key, fmt::format("must be a list of 1 to {} lists of {} numbers, and is {}", max, columns, kind_of(list)));
  std::vector<std::vector<double>> rows;
  for (Json::ArrayIndex i = 0; i < list.size(); ++i) {
    if (!list[i].isArray() || list[i].size() != columns)
      fail(key, fmt::format("entry {} must be a list of {} numbers, and is {}", i, columns, kind_of(list[i])));
    std::vector<double>& row = rows.emplace_back();
    for (const Json::Value& value : list[i]) row.push_back(to_number(*this, value, key, {}));
  }
  return rows;
}

std::vector<Entry> Object::entries(std::string_view key, std::size_t max) {
  if (!has(key)) return {};
  const Json::Value& value = json(value_)[std::string(key)];
  std::vector<Entry> list;
  const auto add = [&](const Json::Value& entry, const std::string& name) {
    const std::string place = fmt::format("{}:{}", data_->file.string(), data_->line_at(entry.getOffsetStart()));
    if (entry.isString() && !entry.asString().empty() && entry.asString().find('\0') == std::string::npos)
      list.push_back({entry.asString(), {}, place});
    else if (entry.isObject())
      list.push_back({"", Object(data_, &entry, name), place});
    else
      fail(key, fmt::format("must be a text or an object, or a list of them, and holds {}", kind_of(entry)));
  };
  if (!value.isArray()) {
    add(value, full_name(name_, key));
    return list;
  }
  if (value.size() > max) fail(key, fmt::format("must have at most {} entries, and has {}", max, value.size()));
  for (Json::ArrayIndex i = 0; i < value.size(); ++i) add(value[i], fmt::format("{}[{}]", full_name(name_, key), i));
  return list;
}

std::string Object::find_place(std::string_view key) const {
  const Json::Value& object = json(value_);
  const auto offset =
      !key.empty() && object.isMember(std::string(key)) ? find_key_offset(*data_, object[std::string(key)], key) : object.getOffsetStart();
  return fmt::format("{}:{}", data_->file.string(), data_->line_at(offset));
}

Object Object::object(std::string_view key) {
  const Json::Value& value = json(require_value(key));
  if (!value.isObject()) fail(key, fmt::format("must be an object in braces, and is {}", kind_of(value)));
  return Object(data_, &value, full_name(name_, key));
}

std::optional<Object> Object::object_if(std::string_view key) { return has(key) ? std::optional(object(key)) : std::nullopt; }

std::vector<Object> Object::objects(std::string_view key) {
  std::vector<Object> list;
  if (!has(key)) return list;
  const Json::Value& value = json(value_)[std::string(key)];
  if (!value.isArray()) fail(key, fmt::format("must be a list in square brackets, and is {}", kind_of(value)));
  for (Json::ArrayIndex i = 0; i < value.size(); ++i) {
    if (!value[i].isObject()) fail(key, fmt::format("entry {} must be an object in braces, and is {}", i, kind_of(value[i])));
    list.emplace_back(data_, &value[i], fmt::format("{}[{}]", full_name(name_, key), i));
  }
  return list;
}

std::filesystem::path Object::path(std::string_view key) {
  const std::filesystem::path named = string(key);
  return std::filesystem::absolute(named.is_absolute() ? named : data_->file.parent_path() / named).lexically_normal();
}

void Object::ignore(std::string_view key) { has(key); }

Object::Excerpt Object::make_excerpt(const std::vector<std::string>& keys) {
  const Json::Value& object = json(value_);
  std::vector<std::string> found;
  for (const std::string& key : keys)
    if (has(key)) found.push_back(key);
  std::sort(found.begin(), found.end(),
            [&](const auto& a, const auto& b) { return object[a].getOffsetStart() < object[b].getOffsetStart(); });
  Excerpt excerpt{.text = "{", .first_line = found.empty() ? 1 : data_->line_at(find_key_offset(*data_, object[found[0]], found[0]))};
  int line = excerpt.first_line;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Json::Value& value = object[found[i]];
    if (i > 0) excerpt.text += ", ";
    for (; line < data_->line_at(find_key_offset(*data_, value, found[i])); ++line) excerpt.text += '\n';
    excerpt.text += fmt::format("\"{}\": ", found[i]);
    for (; line < data_->line_at(value.getOffsetStart()); ++line) excerpt.text += '\n';
    const std::string own = data_->text.substr(static_cast<std::size_t>(value.getOffsetStart()),
                                               static_cast<std::size_t>(value.getOffsetLimit() - value.getOffsetStart()));
    line += static_cast<int>(std::count(own.begin(), own.end(), '\n'));
    excerpt.text += own;
  }
  excerpt.text += "}\n";
  return excerpt;
}

std::vector<std::string> Object::keys() const {
  const Json::Value& object = json(value_);
  std::vector<std::string> names = object.getMemberNames();
  std::sort(names.begin(), names.end(),
            [&](const auto& a, const auto& b) { return object[a].getOffsetStart() < object[b].getOffsetStart(); });
  return names;
}

void Object::finish() {
  // A key that is not there yet is likelier meant than one that is: alpha2_s next to alpha1_s is alpha2_per_s.
  std::vector<std::string> open;
  for (const std::string& key : *asked_)
    if (!json(value_).isMember(key)) open.push_back(key);
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

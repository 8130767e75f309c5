// Views of a document. Each Object records the requested keys, so the set of known keys is exactly what the code reads.
#include "runtime/base/document.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "runtime/base/document_data.hpp"
#include "runtime/base/foreign.hpp"

namespace carillon::base {
namespace {

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "\"" : ", \"") + word + "\"";
  return text;
}

}  // namespace

Document::Document(std::shared_ptr<DocumentData> data) : data_(std::move(data)) {}
Object Document::root() const { return Object(data_, &data_->root, ""); }
void Document::show_paths() { data_->has_paths = true; }
const std::filesystem::path& Document::file() const { return data_->file; }
std::size_t Document::count_scanned_bytes() const { return data_->scanned_bytes; }

Object::Object(std::shared_ptr<DocumentData> data, const Value* value, std::string name)
    : data_(std::move(data)), value_(value), name_(std::move(name)), asked_(std::make_shared<std::vector<std::string>>()) {}

bool Object::has(std::string_view key) {
  if (std::find(asked_->begin(), asked_->end(), key) == asked_->end()) asked_->emplace_back(key);
  return value_->find(key) != nullptr;
}

bool Object::has_string(std::string_view key) { return has(key) && value_->find(key)->is(Value::Kind::kText); }
bool Object::has_number(std::string_view key) { return has(key) && value_->find(key)->is(Value::Kind::kNumber); }
bool Object::has_object(std::string_view key) { return has(key) && value_->find(key)->is(Value::Kind::kObject); }
bool Object::is_empty_list(std::string_view key) {
  return has(key) && value_->find(key)->is(Value::Kind::kList) && value_->find(key)->items.empty();
}

namespace {

std::string full_name(const std::string& name, std::string_view key) {
  const std::string_view shown = key.substr(0, 80);  // bounds untrusted keys
  return name.empty() ? std::string(shown) : fmt::format("{}.{}", name, shown);
}

}  // namespace

void Object::fail(std::string_view key, const std::string& message) const {
  const Value* member = key.empty() ? nullptr : value_->find(key);
  if (member != nullptr) data_->fail(member->key_offset, fmt::format("\"{}\": {}", full_name(name_, key), message));
  const std::string name = key.empty() ? (data_->has_paths ? name_ : "") : full_name(name_, key);
  data_->fail(value_->offset, name.empty() ? message : fmt::format("\"{}\": {}", name, message));
}

namespace {

/// Damerau-Levenshtein distance with adjacent transpositions; three rows.
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

/// Key of `present` probably meant by `wanted`: distance at most a quarter of its length, or one contains the other.
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

const Value& Object::require_value(std::string_view key) {
  if (!has(key)) {
    const std::string near = find_misspelt(key, keys(), *asked_);
    fail(near, near.empty() ? fmt::format("\"{}\" is missing here; add it", key)
                            : fmt::format("unknown key; \"{}\" is required here: did you mean \"{}\"?", key, key));
  }
  return *value_->find(key);
}

std::string Object::string(std::string_view key) {
  const Value& value = require_value(key);
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

double Object::number(std::string_view key, Range range) { return to_number(*this, require_value(key), key, range); }
double Object::number_or(std::string_view key, double fallback, Range range) { return has(key) ? number(key, range) : fallback; }

long long Object::integer(std::string_view key, long long low, long long high) {
  const Value& value = require_value(key);
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
  const Value& value = *value_->find(key);
  if (!value.is(Value::Kind::kBoolean)) fail(key, fmt::format("must be true or false, and is {}", kind_of(value)));
  return value.is_true;
}

void Object::copy_numbers(std::string_view key, double* values, std::size_t count) {
  const Value& list = require_value(key);
  if (!list.is(Value::Kind::kList) || list.items.size() != count)
    fail(key, fmt::format("must be a list of {} numbers, and is {}", count, kind_of(list)));
  for (std::size_t i = 0; i < count; ++i) values[i] = to_number(*this, list.items[i], key, {});
}

std::vector<double> Object::number_list(std::string_view key, std::size_t max) {
  const Value& list = require_value(key);
  if (!list.is(Value::Kind::kList) || list.items.empty() || list.items.size() > max)
    fail(key, fmt::format("must be a list of 1 to {} numbers, and is {}", max, kind_of(list)));
  std::vector<double> values(list.items.size());
  copy_numbers(key, values.data(), values.size());
  return values;
}

std::vector<std::vector<double>> Object::number_rows(std::string_view key, std::size_t columns, std::size_t max) {
  const Value& list = require_value(key);
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
  const Value& value = *value_->find(key);
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
  const Value* member = key.empty() ? nullptr : value_->find(key);
  return fmt::format("{}:{}", data_->file.string(), data_->line_at(member != nullptr ? member->key_offset : value_->offset));
}

Object Object::object(std::string_view key) {
  const Value& value = require_value(key);
  if (!value.is(Value::Kind::kObject)) fail(key, fmt::format("must be an object in braces, and is {}", kind_of(value)));
  return Object(data_, &value, full_name(name_, key));
}

std::optional<Object> Object::object_if(std::string_view key) { return has(key) ? std::optional(object(key)) : std::nullopt; }

std::vector<Object> Object::objects(std::string_view key) {
  std::vector<Object> list;
  if (!has(key)) return list;
  const Value& value = *value_->find(key);
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

/// Offset of the first byte from `at` on that is neither white space nor comment, in valid text.
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

/// Offset past the quoted string at `at`.
std::size_t skip_quoted(std::string_view text, std::size_t at) {
  for (++at; at < text.size() && text[at] != '"'; ++at)
    if (text[at] == '\\') ++at;
  return at + 1;
}

/// Offset past the value at `at`.
std::size_t find_end(std::string_view text, std::size_t at, const Value& value) {
  if (value.is(Value::Kind::kList) || value.is(Value::Kind::kObject)) return value.end;
  if (value.is(Value::Kind::kText)) return skip_quoted(text, at);
  return std::min(text.find_first_of(" \t\r\n,]}/", at), text.size());
}

}  // namespace

Object::Excerpt Object::make_excerpt(const std::vector<std::string>& keys) {
  std::vector<const Value*> found;
  for (const std::string& key : keys)
    if (has(key)) found.push_back(value_->find(key));
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
  for (const Value& member : value_->items) names.push_back(member.key);
  return names;
}

void Object::finish() {
  // Prefer keys that are still unused: next to alpha1_s, alpha2_s means alpha2_per_s.
  std::vector<std::string> open;
  for (const std::string& key : *asked_)
    if (value_->find(key) == nullptr) open.push_back(key);
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

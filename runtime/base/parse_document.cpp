// Parser of documents. RapidJSON events become values with text offsets, from which line numbers are computed.
#include <fmt/core.h>
#include <rapidjson/error/en.h>
#include <rapidjson/reader.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <numeric>

#include "runtime/base/document.hpp"
#include "runtime/base/document_data.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/foreign.hpp"

namespace carillon::base {

const Value* Value::find(std::string_view wanted) const {
  const auto at = std::lower_bound(by_key.begin(), by_key.end(), wanted,
                                   [this](std::uint32_t i, std::string_view other) { return items[i].key < other; });
  return at != by_key.end() && items[*at].key == wanted ? &items[*at] : nullptr;
}

int DocumentData::line_at(std::ptrdiff_t offset) const {
  if (scanned_bytes == 0) {
    scanned_bytes = text.size();
    for (std::size_t at = text.find('\n'); at != std::string::npos; at = text.find('\n', at + 1)) line_ends.push_back(at);
  }
  const std::size_t end = std::max<std::ptrdiff_t>(offset, 0);
  return first_line + static_cast<int>(std::lower_bound(line_ends.begin(), line_ends.end(), end) - line_ends.begin());
}

void DocumentData::fail(std::ptrdiff_t offset, const std::string& message) const {
  throw PlacedError(fmt::format("{}:{}", file.string(), line_at(offset)), message);
}

// By the standard library: RapidJSON's conversion has undefined behaviour for leading zeros.
std::optional<double> to_double(std::string_view text) {
#ifdef __cpp_lib_to_chars
  double number = 0.0;
  auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc::result_out_of_range) {
    // Over- or underflow: parse as long double. Beyond its range too, the number is small if its exponent is negative or its integer part
    // is 0, since RapidJSON rejects exponents above 308.
    long double wide = 0.0L;
    const bool is_within = std::from_chars(text.data(), text.data() + text.size(), wide).ec == std::errc();
    if (!is_within && text.find('-', 1) == std::string_view::npos && text.substr(text.starts_with('-') ? 1 : 0, 1) != "0")
      return std::nullopt;
    number = static_cast<double>(wide);
    error = std::errc();
  }
  if (error != std::errc()) return std::nullopt;
#else
  const double number = std::strtod(std::string(text).c_str(), nullptr);  // WebAssembly has one locale only
#endif
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

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

namespace {

constexpr std::uint64_t kMaxBytes = 16u << 20;
constexpr int kMaxDepth = 100;

/// Builds Values from rapidjson::Reader events, with numbers as text.
class Builder : public rapidjson::BaseReaderHandler<rapidjson::UTF8<>, Builder> {
 public:
  Builder(const DocumentData& data, const rapidjson::StringStream& stream, Value& root) : data_(&data), stream_(&stream), open_{&root} {}

  bool Null() { return add({}); }
  bool Bool(bool is_true) { return add({.kind = Value::Kind::kBoolean, .is_true = is_true}); }
  bool RawNumber(const char* text, rapidjson::SizeType size, bool) { return add_number({text, size}); }
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
  /// Offset within the last token, or just past it; tokens do not span lines.
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
    Value* place = &into;
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
  std::vector<Value*> open_;  // open containers, root first; only the last grows, so pointers stay valid
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

/// Fault of a word that begins like a number, for a message; nullptr for a valid JSON number.
const char* find_number_fault(std::string_view word) {
  const auto skip_digits = [&] {
    const std::size_t digits = std::min(word.find_first_not_of("0123456789"), word.size());
    word.remove_prefix(digits);
    return digits;
  };
  const bool is_signed = word.starts_with('-');
  if (word.starts_with('+')) return "a number has no plus sign; remove it";
  if (is_signed) word.remove_prefix(1);
  const bool has_zero = word.starts_with('0');
  const std::size_t whole = skip_digits();
  if (whole == 0) {
    if (word.starts_with('.')) return "there has to be a digit before the point: 0.5, not .5";
    return is_signed ? "a minus sign is followed by digits" : "this is not a number";
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

/// Checks before parsing: bracket depth, which bounds the parser's recursion, and number syntax, with clearer messages.
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

}  // namespace carillon::base

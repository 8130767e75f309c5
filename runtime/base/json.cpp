#include "runtime/base/json.hpp"

#include <fmt/format.h>
#include <rapidjson/reader.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "runtime/base/document_data.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::base {
namespace {

double require_finite(double value) {
  if (!std::isfinite(value)) throw std::invalid_argument(fmt::format("JSON has no number for {}", value));
  return value;
}

/// Bytes that are not UTF-8 become U+FFFD if escaped.
std::string quote_sorted(std::string_view text, bool is_ascii) {
  std::string out = "\"";
  while (!text.empty()) {
    constexpr std::string_view kSpecial = "\"\\\b\f\n\r\t", kLetters = "\"\\bfnrt";
    const auto c = static_cast<unsigned char>(text[0]);
    std::size_t bytes = 1;
    if (const std::size_t i = kSpecial.find(text[0]); i != std::string_view::npos) {
      out.append("\\") += kLetters[i];
    } else if (c >= 0x20 && (c < 0x80 || !is_ascii)) {
      out += text[0];
    } else {
      const Character character = decode_utf8(text);
      append_unicode_escape(out, character.bytes > 0 ? character.code : 0xFFFD);
      bytes = std::max<std::size_t>(character.bytes, 1);
    }
    text.remove_prefix(bytes);
  }
  return out + '"';
}

/// 17 digits; integers of type double keep ".0".
std::string format_real(double value) {
  std::string text = fmt::format("{:.17g}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

}  // namespace

/// Makes a Json of the events of a rapidjson::Reader, with numbers as text.
class JsonBuilder : public rapidjson::BaseReaderHandler<rapidjson::UTF8<>, JsonBuilder> {
 public:
  explicit JsonBuilder(Json& root) : root_(&root) {}
  bool Null() { return put({}); }
  bool Bool(bool value) { return put(value); }
  bool RawNumber(const char* text, rapidjson::SizeType size, bool) {
    const char* const end = text + size;
    std::int64_t integer = 0;
    if (const auto [last, error] = std::from_chars(text, end, integer); error == std::errc() && last == end) return put(integer);
    std::uint64_t large = 0;
    if (const auto [last, error] = std::from_chars(text, end, large); error == std::errc() && last == end) return put(large);
    const std::optional<double> real = to_double({text, size});
    return real && put(*real);
  }
  bool String(const char* text, rapidjson::SizeType size, bool) { return put(std::string_view(text, size)); }
  bool Key(const char* text, rapidjson::SizeType size, bool) {
    open_.back()->keys_.emplace_back(text, size);
    return true;
  }
  bool StartObject() { return open(Json::object()); }
  bool StartArray() { return open(Json::array()); }
  bool EndArray(rapidjson::SizeType) { return close(); }
  bool EndObject(rapidjson::SizeType) {
    drop_duplicates(*open_.back());
    return close();
  }

 private:
  bool put(Json value) {
    *(open_.empty() ? root_ : &open_.back()->items_.emplace_back()) = std::move(value);
    return true;
  }
  bool open(Json value) {
    constexpr std::size_t kMaxDepth = 100;
    put(std::move(value));
    open_.push_back(open_.empty() ? root_ : &open_.back()->items_.back());
    return open_.size() <= kMaxDepth;
  }
  bool close() {
    open_.pop_back();
    return true;
  }
  static void drop_duplicates(Json& object) {
    std::vector<std::size_t> order(object.keys_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return object.keys_[a] < object.keys_[b]; });
    std::vector<std::size_t> dropped;
    for (std::size_t i = 1; i < order.size(); ++i)
      if (object.keys_[order[i - 1]] == object.keys_[order[i]]) dropped.push_back(order[i - 1]);
    std::sort(dropped.rbegin(), dropped.rend());
    for (const std::size_t i : dropped) {
      object.keys_.erase(object.keys_.begin() + static_cast<std::ptrdiff_t>(i));
      object.items_.erase(object.items_.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }

  Json* root_;
  std::vector<Json*> open_;  // open containers; only the last grows, so pointers stay valid
};

/// Writes Json::sorted_text().
class SortedWriter {
 public:
  explicit SortedWriter(const JsonLayout& layout) : layout_(layout) {}
  std::string run(const Json& root) {
    write(root, false);
    return std::move(out_);
  }

 private:
  static constexpr std::size_t kMaxColumns = 74;  // of an array on one line

  std::string format_scalar(const Json& value) const {
    if (value.kind_ == Json::Kind::string) return quote_sorted(value.text_, layout_.is_ascii);
    if (value.kind_ == Json::Kind::real) return format_real(value.number_);
    const bool is_whole = value.text_.find_first_of(".e") == std::string::npos;
    return value.kind_ == Json::Kind::decimal && !is_whole ? format_real(value.as_double()) : value.format_scalar();
  }
  /// begins_line: also the opening bracket of a container in a container.
  void write(const Json& value, bool begins_line) {
    if (value.empty()) {
      out_ += value.is_array() ? "[]" : value.is_object() ? "{}" : format_scalar(value);
    } else if (value.is_array() && !breaks(value)) {
      const bool is_wide = !layout_.indentation.empty();
      out_ += is_wide ? "[ " : "[";
      for (std::size_t i = 0; i < value.size(); ++i) {
        if (i > 0) out_ += is_wide ? ", " : ",";
        write(value.items_[i], false);
      }
      out_ += is_wide ? " ]" : "]";
    } else {
      if (begins_line) break_line();
      write_lines(value);
    }
  }
  void write_lines(const Json& value) {
    out_ += value.is_array() ? '[' : '{';
    ++depth_;
    std::vector<std::size_t> order(value.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    if (value.is_object())
      std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return value.keys_[a] < value.keys_[b]; });
    for (const std::size_t i : order) {
      if (i != order.front()) out_ += ',';
      break_line();
      if (value.is_object()) out_.append(quote_sorted(value.keys_[i], layout_.is_ascii)).append(layout_.indentation.empty() ? ":" : " : ");
      write(value.items_[i], value.is_object());
    }
    --depth_;
    break_line();
    out_ += value.is_array() ? ']' : '}';
  }
  bool breaks(const Json& array) const {
    std::size_t columns = 4 + 2 * (array.size() - 1);
    if (layout_.breaks_arrays || 3 * array.size() >= kMaxColumns) return true;
    for (const Json& item : array) {
      if (!item.empty()) return true;
      columns += item.is_array() || item.is_object() ? 2 : format_scalar(item).size();
    }
    return columns >= kMaxColumns;
  }
  void break_line() {
    if (layout_.indentation.empty()) return;
    out_ += '\n';
    for (int i = 0; i < depth_; ++i) out_ += layout_.indentation;
  }

  JsonLayout layout_;
  std::string out_;
  int depth_ = 0;
};

Json::Json(double value) : kind_(Kind::real), number_(require_finite(value)) {}

std::optional<Json> Json::parse(const std::string& text) {
  if (text.find('\0') != std::string::npos) return std::nullopt;
  rapidjson::StringStream stream(text.c_str() + (text.starts_with("\xEF\xBB\xBF") ? 3 : 0));  // UTF-8 byte order mark
  Json root;
  JsonBuilder builder(root);
  constexpr unsigned kFlags = rapidjson::kParseNumbersAsStringsFlag | rapidjson::kParseCommentsFlag | rapidjson::kParseIterativeFlag;
  return rapidjson::Reader().Parse<kFlags>(stream, builder).IsError() ? std::nullopt : std::optional(std::move(root));
}

std::size_t Json::find(std::string_view key) const {
  return static_cast<std::size_t>(std::find(keys_.begin(), keys_.end(), key) - keys_.begin());
}

Json& Json::set(std::string_view key, Json value) {
  (*this)[key] = std::move(value);
  return *this;
}

Json& Json::operator[](std::string_view key) {
  if (is_null()) *this = object();
  if (!is_object()) throw std::logic_error("only an object of JSON has members");
  const std::size_t i = find(key);
  if (i < items_.size()) return items_[i];
  keys_.emplace_back(key);
  return items_.emplace_back();
}

const Json& Json::operator[](std::string_view key) const {
  static const Json kAbsent;
  const std::size_t i = find(key);
  return i < keys_.size() ? items_[i] : kAbsent;
}

Json& Json::add(Json value) {
  if (is_null()) *this = array();
  if (!is_array()) throw std::logic_error("only an array of JSON takes another value");
  items_.push_back(std::move(value));
  return *this;
}

Json& Json::append(Json value) { return add(std::move(value)).items_.back(); }
Json& Json::append() { return append(Json()); }

void Json::erase(std::string_view key) {
  const std::size_t i = find(key);
  if (i == keys_.size()) return;
  keys_.erase(keys_.begin() + static_cast<std::ptrdiff_t>(i));
  items_.erase(items_.begin() + static_cast<std::ptrdiff_t>(i));
}

std::vector<std::string> Json::keys() const {
  std::vector<std::string> sorted = keys_;
  std::sort(sorted.begin(), sorted.end());
  return sorted;
}

double Json::as_double() const {
  if (kind_ == Kind::real || is_null()) return number_;
  if (!is_number()) throw std::logic_error("a value of JSON is not a number");
  return to_double(text_).value_or(0.0);
}

const std::string& Json::as_string() const {
  if (!is_string() && !is_null()) throw std::logic_error("a value of JSON is not a string");
  return text_;
}

std::string Json::line() const {
  std::string out;
  append_line(out);
  return out;
}

std::string Json::text(std::size_t columns) const {
  std::string out;
  append_lines(out, 0, columns, columns);  // the root is always broken
  return out + '\n';
}

std::string Json::sorted_text(const JsonLayout& layout) const { return SortedWriter(layout).run(*this); }

std::string Json::format_scalar() const {
  switch (kind_) {
    case Kind::null:
      return "null";
    case Kind::boolean:
      return number_ != 0.0 ? "true" : "false";
    case Kind::real:
      return fmt::format("{}", number_);
    case Kind::string:
      return quote(text_);
    default:
      return text_;
  }
}

void Json::append_line(std::string& out) const {
  if (!is_array() && !is_object()) {
    out += format_scalar();
    return;
  }
  out += is_array() ? '[' : '{';
  for (std::size_t i = 0; i < items_.size(); ++i) {
    if (i > 0) out += ", ";
    if (is_object()) out.append(quote(keys_[i])).append(": ");
    items_[i].append_line(out);
  }
  out += is_array() ? ']' : '}';
}

/// `taken`: columns already used on the line.
void Json::append_lines(std::string& out, std::size_t indentation, std::size_t columns, std::size_t taken) const {
  const std::size_t before = out.size();
  append_line(out);
  if (items_.empty() || taken + out.size() - before < columns) return;
  out.resize(before);
  out += is_array() ? '[' : '{';
  for (std::size_t i = 0; i < items_.size(); ++i) {
    out.append(i > 0 ? ",\n" : "\n").append(indentation + 2, ' ');
    const std::string name = is_object() ? quote(keys_[i]) + ": " : "";
    out += name;
    items_[i].append_lines(out, indentation + 2, columns, indentation + 2 + name.size());
  }
  out.append("\n").append(indentation, ' ') += is_array() ? ']' : '}';
}

Json significant(double value, int digits) { return Json(Json::Kind::decimal, fmt::format("{:.{}g}", require_finite(value), digits)); }
Json decimals(double value, int places) { return Json(Json::Kind::decimal, fmt::format("{:.{}f}", require_finite(value), places)); }

}  // namespace carillon::base

#include "runtime/base/json.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "runtime/base/printable.hpp"

namespace carillon::base {
namespace {

double require_finite(double value) {
  if (!std::isfinite(value)) throw std::invalid_argument(fmt::format("JSON has no number for {}", value));
  return value;
}

}  // namespace

Json::Json(double value) : text_(fmt::format("{}", require_finite(value))) {}
Json::Json(std::string_view value) : text_(quote(value)) {}

Json Json::object() { return Json(Kind::object, ""); }
Json Json::array() { return Json(Kind::array, ""); }

Json& Json::set(std::string_view key, Json value) {
  member(key) = std::move(value);
  return *this;
}

Json& Json::member(std::string_view key) {
  if (kind_ == Kind::scalar && text_ == "null") *this = object();
  if (kind_ != Kind::object) throw std::logic_error("only an object of JSON has members");
  const auto found = std::find_if(parts_.begin(), parts_.end(), [&](const auto& part) { return part.first == key; });
  return found != parts_.end() ? found->second : parts_.emplace_back(key, Json()).second;
}

Json& Json::add(Json value) {
  if (kind_ == Kind::scalar && text_ == "null") *this = array();
  if (kind_ != Kind::array) throw std::logic_error("only an array of JSON takes another value");
  parts_.emplace_back("", std::move(value));
  return *this;
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

void Json::append_line(std::string& out) const {
  if (kind_ == Kind::scalar) {
    out += text_;
    return;
  }
  out += kind_ == Kind::array ? '[' : '{';
  const char* between = "";
  for (const auto& [key, value] : parts_) {
    out += between;
    if (kind_ == Kind::object) out.append(quote(key)).append(": ");
    value.append_line(out);
    between = ", ";
  }
  out += kind_ == Kind::array ? ']' : '}';
}

/// `taken`: columns already used on the line.
void Json::append_lines(std::string& out, std::size_t indentation, std::size_t columns, std::size_t taken) const {
  const std::size_t before = out.size();
  append_line(out);
  if (parts_.empty() || taken + out.size() - before < columns) return;
  out.resize(before);
  out += kind_ == Kind::array ? '[' : '{';
  const char* between = "\n";
  for (const auto& [key, value] : parts_) {
    out.append(between).append(indentation + 2, ' ');
    const std::string name = kind_ == Kind::object ? quote(key) + ": " : "";
    out += name;
    value.append_lines(out, indentation + 2, columns, indentation + 2 + name.size());
    between = ",\n";
  }
  out.append("\n").append(indentation, ' ') += kind_ == Kind::array ? ']' : '}';
}

Json significant(double value, int digits) { return Json(Json::Kind::scalar, fmt::format("{:.{}g}", require_finite(value), digits)); }
Json decimals(double value, int places) { return Json(Json::Kind::scalar, fmt::format("{:.{}f}", require_finite(value), places)); }

}  // namespace carillon::base

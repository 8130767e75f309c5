#include "runtime/base/keys.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "runtime/base/ranges.hpp"

namespace carillon::base {
namespace {

std::string describe_limits(const Limits& limits, const std::string& unit) {
  const bool is_below = std::isfinite(limits.low), is_above = std::isfinite(limits.high);
  if (is_below && is_above) return fmt::format("; {} to {}{}{}", limits.low, limits.high, unit, limits.is_open ? ", both excluded" : "");
  if (is_below) return fmt::format("; {} {}{}", limits.is_open ? "above" : "at least", limits.low, unit);
  return is_above ? fmt::format("; at most {}{}", limits.high, unit) : unit.empty() ? "" : ";" + unit;
}

}  // namespace

double read_value(Object& object, const char* key, const Limits& limits, const double*) {
  return limits.is_open ? object.number(key, {limits.low, limits.high}) : read_within(object, key, limits.low, limits.high);
}

long long read_value(Object& object, const char* key, const Limits& limits, const long long*) {
  return object.integer(key, static_cast<long long>(limits.low), static_cast<long long>(limits.high));
}

bool read_value(Object& object, const char* key, const Limits&, const bool*) { return object.boolean_or(key, false); }
std::string read_value(Object& object, const char* key, const Limits&, const std::string*) { return object.string(key); }
std::filesystem::path read_value(Object& object, const char* key, const Limits&, const std::filesystem::path*) { return object.path(key); }

Vec3 read_value(Object& object, const char* key, const Limits& limits, const Vec3*) {
  return read_vector_within(object, key, limits.low, limits.high);
}

std::size_t read_word(Object& object, const char* key, const std::vector<std::string>& words) {
  return std::find(words.begin(), words.end(), object.choice(key, words)) - words.begin();
}

Json to_json(const KeyValue& value) {
  return std::visit(
      [](const auto& held) {
        using Held = std::decay_t<decltype(held)>;
        if constexpr (std::is_same_v<Held, std::monostate>)
          return Json();
        else if constexpr (std::is_same_v<Held, Vec3>)
          return Json::array(held);
        else
          return Json(held);
      },
      value);
}

KeyText describe_key(const char* name, const KeyValue& fallback, Need need, const char* meaning, const Limits& limits,
                     const std::vector<std::string>& words) {
  const double* number = std::get_if<double>(&fallback);
  const long long* count = std::get_if<long long>(&fallback);
  const double value = number != nullptr ? *number : count != nullptr ? static_cast<double>(*count) : limits.low;
  const bool is_set = fallback.index() != 0 && value >= limits.low && value <= limits.high;  // members of required keys begin as 0
  const std::string shown = is_set ? fmt::format("`{}`", to_json(fallback).line()) : "none";
  const std::string choices = words.empty() ? "" : fmt::format(": `\"{}\"`", fmt::join(words, "\"`, `\""));
  return {name, need == Need::required ? "required" : shown, meaning + choices + describe_limits(limits, find_unit(name))};
}

std::string write_key_tables(const std::vector<KeyTable>& tables) {
  std::string text;
  for (const KeyTable& table : tables) {
    text += fmt::format("# {}\n\n| key | default | meaning |\n|---|---|---|\n", table.title);
    for (const KeyText& row : table.rows) text += fmt::format("| `{}` | {} | {} |\n", row.name, row.fallback, row.meaning);
    text += '\n';
  }
  return text;
}

}  // namespace carillon::base

// Escaping of untrusted text, number formats, JSON output.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string_view>

#include "jobs/cli/shared.hpp"
#include "jobs/store/records.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::cli {
namespace {

std::string escape(const std::string& raw, std::size_t max) {
  const std::string text = base::printable(store::to_text(raw));
  std::size_t end = std::min(max, text.size());
  while (end < text.size() && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) ++end;  // at a character boundary
  return end < text.size() ? text.substr(0, end) + "..." : text;
}

}  // namespace

std::string show(const std::string& text, std::size_t max) { return escape(text, max); }

std::string show_message(const std::string& text) { return base::show_message(store::to_text(text)); }

base::Json to_json(const std::string& text) { return base::Json(store::to_text(text)); }

base::Json to_json_time(double unix_s) {
  if (!(unix_s > 0) || unix_s > 1e11) return {};
  const auto seconds = static_cast<std::time_t>(unix_s);
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday, parts.tm_hour,
                     parts.tm_min, parts.tm_sec);
}

void print_json(const base::Json& root) {
  fmt::print("{}\n", store::to_plain_json(root.sorted_text({.indentation = "  ", .is_ascii = false})));
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
}

std::string format_seconds(double seconds) {
  if (!(seconds >= 0)) return "?";
  if (seconds < 60) return fmt::format("{:.0f} s", seconds);
  const auto whole = static_cast<long long>(std::min(seconds, 1e15));
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

std::string format_bytes(double bytes) {
  constexpr std::string_view kUnits[] = {"B", "kB", "MB", "GB", "TB"};
  std::size_t unit = 0;
  for (; bytes >= 1000 && unit < 4; ++unit) bytes /= 1000;
  return fmt::format("{:.{}f} {}", bytes, unit == 0 ? 0 : 1, kUnits[unit]);
}

}  // namespace carillon::cli

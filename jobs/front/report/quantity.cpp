#include "jobs/front/report/quantity.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>

namespace carillon::report {

std::string format_count(std::int64_t count) {
  const std::string digits = fmt::format("{}", count);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    text += digits[i];
    const std::size_t left = digits.size() - i - 1;
    if (digits[i] != '-' && left > 0 && left % 3 == 0) text += ',';
  }
  return text;
}

std::string format_bytes(double bytes) {
  if (std::abs(bytes) < 1e3) return fmt::format("{:.0f} B", bytes);
  if (std::abs(bytes) < 1e6) return fmt::format("{:.1f} kB", bytes / 1e3);
  if (std::abs(bytes) < 1e9) return fmt::format("{:.1f} MB", bytes / 1e6);
  if (std::abs(bytes) < 1e15) return fmt::format("{:.2f} GB", bytes / 1e9);
  return fmt::format("{:.3g} GB", bytes / 1e9);
}

std::string format_seconds(double seconds) {
  if (std::abs(seconds) < 0.0995) return fmt::format("{:.0f} ms", 1e3 * seconds);
  if (std::abs(seconds) < 99.5) return fmt::format("{:.2f} s", seconds);
  if (!(std::abs(seconds) < 1e12)) return fmt::format("{:.3g} s", seconds);
  const auto whole = static_cast<std::int64_t>(std::llround(seconds));
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", format_count(whole / 3600), whole % 3600 / 60);
}

std::string format_hz(double freq_hz) { return fmt::format("{:.2f} Hz", freq_hz); }

std::string format_cents(double cents) {
  if (!std::isfinite(cents)) return "unknown";  // a list too short for a bar
  return std::abs(cents) >= 9.95 && std::abs(cents) < 1e7 ? fmt::format("{:.0f} cent", cents) : fmt::format("{:.2g} cent", cents);
}

std::string format_percent(double share) {
  if (share > 0.0 && share < 0.0005) return "< 0.1 %";
  return std::abs(share) < 0.0995 ? fmt::format("{:.1f} %", 100.0 * share) : fmt::format("{:.0f} %", 100.0 * share);
}

std::string format_plain(double value) { return fmt::format("{:.6g}", value); }

std::string format_large(double value) {
  constexpr std::array<const char*, 7> kPrefix{"", " k", " M", " G", " T", " P", " E"};
  std::size_t at = 0;
  while (std::abs(value) >= 999.5 && at + 1 < kPrefix.size()) value /= 1e3, ++at;
  return fmt::format("{:.3g}{}", value, kPrefix[at]);
}

}  // namespace carillon::report

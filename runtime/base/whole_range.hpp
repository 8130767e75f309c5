// Integers as command-line options.
#pragma once

#include <fmt/core.h>

#include <charconv>
#include <functional>
#include <string>

namespace carillon::base {

/// Validator for CLI::Option::check(): integers from low to high; returns the fault or an empty string.
inline std::function<std::string(const std::string&)> whole_range(long long low, long long high) {
  return [low, high](const std::string& word) -> std::string {
    long long value = 0;
    const char* const end = word.data() + word.size();
    const auto read = std::from_chars(word.data() + (word.starts_with('+') ? 1 : 0), end, value);
    if (read.ec == std::errc() && read.ptr == end && value >= low && value <= high) return {};
    return fmt::format("must be a whole number from {} to {}, and is '{}'", low, high, word);
  };
}

/// Type shown by --help.
inline std::string describe_whole_range(long long low, long long high) { return fmt::format("INT in [{} - {}]", low, high); }

}  // namespace carillon::base

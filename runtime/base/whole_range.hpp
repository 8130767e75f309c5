// Whole numbers as options of command lines.
#pragma once

#include <fmt/core.h>

#include <charconv>
#include <functional>
#include <string>

namespace carillon::base {

/// Check of a whole number from low to high for CLI::Option::check(): the fault of a word, or empty.
inline std::function<std::string(const std::string&)> whole_range(long long low, long long high) {
  return [low, high](const std::string& word) -> std::string {
    long long value = 0;
    const char* const end = word.data() + word.size();
    const auto read = std::from_chars(word.data() + (word.starts_with('+') ? 1 : 0), end, value);
    if (read.ec == std::errc() && read.ptr == end && value >= low && value <= high) return {};
    return fmt::format("must be a whole number from {} to {}, and is '{}'", low, high, word);
  };
}

/// Type of the option in --help.
inline std::string describe_whole_range(long long low, long long high) { return fmt::format("INT in [{} - {}]", low, high); }

}  // namespace carillon::base

// Options of command lines that are whole numbers.
#pragma once

#include <fmt/core.h>

#include <charconv>
#include <functional>
#include <string>

namespace carillon::base {

/// For CLI::Option::check(): what is wrong with the word of an option that is to be a whole number from low to high; empty if nothing is.
inline std::function<std::string(const std::string&)> whole_range(long long low, long long high) {
  return [low, high](const std::string& word) -> std::string {
    long long value = 0;
    const char* const end = word.data() + word.size();
    const auto read = std::from_chars(word.data() + (word.starts_with('+') ? 1 : 0), end, value);
    if (read.ec == std::errc() && read.ptr == end && value >= low && value <= high) return {};
    return fmt::format("must be a whole number from {} to {}, and is '{}'", low, high, word);
  };
}

/// What --help says of such an option.
inline std::string describe_whole_range(long long low, long long high) { return fmt::format("INT in [{} - {}]", low, high); }

}  // namespace carillon::base

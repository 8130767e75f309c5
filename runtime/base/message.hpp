// Error messages that contain untrusted text.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace carillon::base {

/// Elides the middle of words above 600 bytes and of texts above 4,000.
std::string shorten(std::string_view text);

/// Shortened and printable, on one line.
std::string show_message(std::string_view text);

/// Path for messages: the target of "/proc/self/fd/N/NAME" while N is open; other paths unchanged.
std::string find_name(const std::filesystem::path& file);

/// Remedy for a file that cannot be created, written or locked; `error`: errno.
const char* find_advice(int error);

}  // namespace carillon::base

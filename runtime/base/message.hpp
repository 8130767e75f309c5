// Messages of errors, with untrusted text in them.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace carillon::base {

/// Cuts words above 600 bytes and texts above 4,000 in their middle.
std::string shorten(std::string_view text);

/// A message for a terminal: shortened and printable, on one line.
std::string show_message(std::string_view text);

/// The path of a file for people: the target of "/proc/self/fd/N/NAME" while N is open; other paths unchanged.
std::string find_name(const std::filesystem::path& file);

/// Advice for the end of a message on a file that cannot be made, written or locked; error: of errno.
const char* find_advice(int error);

}  // namespace carillon::base

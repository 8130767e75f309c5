// Messages of errors, which may name what strangers wrote.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace carillon::base {

/// `text` with what is too long for a person cut in its middle: words of more than 600 bytes, and all of it at 4,000.
std::string shorten(std::string_view text);

/// A message for a terminal: shortened and printable, on one line.
std::string show_message(std::string_view text);

/// The name by which people know a file: where "/proc/self/fd/N/NAME" leads, while N is open; others as they are.
std::string find_name(const std::filesystem::path& file);

/// What to do about `error`, a value of errno, of a file that cannot be made, written or locked: the end of a message.
const char* find_advice(int error);

}  // namespace carillon::base

// Files of the page's folder.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"

namespace carillon::explore {

/// Letters, digits, dots, "_" and "-": what is harmless in the name of a file and in an address. Never empty, no dot at its beginning.
std::string make_name(std::string_view text);

/// With all digits of numbers, on many lines.
std::string to_text(const base::Json& value);

/// Throw SystemError when the disk refuses.
void put_file(const std::filesystem::path& from, const std::filesystem::path& to);
void put_folder(const std::filesystem::path& from, const std::filesystem::path& to);
/// `file` becomes `file`.gz.
void compress_file(const std::filesystem::path& file);
std::uintmax_t calc_bytes(const std::filesystem::path& folder);

}  // namespace carillon::explore

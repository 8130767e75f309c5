// Files of the page's folder.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"

namespace carillon::explore {

/// Letters, digits, dots, "_" and "-" only (safe in file names and URLs). Never empty, no initial dot.
std::string make_name(std::string_view text);

/// Indented, with all digits.
std::string to_text(const base::Json& value);

/// SystemError when the disk refuses.
void put_file(const std::filesystem::path& from, const std::filesystem::path& to);
void put_folder(const std::filesystem::path& from, const std::filesystem::path& to);
/// Compresses `file` to `file`.gz.
void compress_file(const std::filesystem::path& file);
std::uintmax_t calc_bytes(const std::filesystem::path& folder);

}  // namespace carillon::explore

// Diagnosis of UTF-16 text and of paths with backslashes.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// Throws InputError beginning with `name` for UTF-16: byte-order mark, or zeros in every other byte.
void refuse_utf16(std::string_view bytes, std::string_view name);

/// "; use / between folders, not \" if the path contains a backslash, else empty; appended to messages on missing files.
std::string hint_backslash(const std::filesystem::path& file);

}  // namespace carillon::base

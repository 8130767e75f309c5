// Errors that name habits of other systems: texts in UTF-16, paths with backslashes.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// Throws InputError that begins with `name` for text in UTF-16: a byte-order mark, or zeros in every other byte. Any bytes are safe.
void refuse_utf16(std::string_view bytes, std::string_view name);

/// Last part of the message for a missing file: "; use / between folders, not \" for a path with backslashes, else empty.
std::string hint_backslash(const std::filesystem::path& file);

}  // namespace carillon::base

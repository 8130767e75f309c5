// What users of other systems bring along, named so that it can be corrected: texts in UTF-16, and paths with backslashes.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// Throws InputError that begins with `name` if a text begins as UTF-16 does: with a mark, or with characters of which every other byte is
/// zero. Safe with any bytes.
void refuse_utf16(std::string_view bytes, std::string_view name);

/// For the end of a message that there is no such file: "; use / between folders, not \" if its path has backslashes, else nothing.
std::string hint_backslash(const std::filesystem::path& file);

}  // namespace carillon::base

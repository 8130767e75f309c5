#include "runtime/base/foreign.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>

namespace carillon::base {
namespace {

/// True if the odd (`first` = 0, little endian) or even (1) bytes of the first characters are zero.
bool has_zeros(std::string_view bytes, std::size_t first, std::size_t characters) {
  if (bytes.size() < 2 * characters) return false;
  for (std::size_t i = 0; i < characters; ++i)
    if (bytes[2 * i + 1 - first] != '\0' || bytes[2 * i + first] == '\0') return false;
  return true;
}

}  // namespace

void refuse_utf16(std::string_view bytes, std::string_view name) {
  constexpr std::size_t kMarked = 1, kUnmarked = 4;  // characters to check with and without a byte-order mark
  const bool is_marked = bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF");
  const std::string_view text = is_marked ? bytes.substr(2) : bytes;
  const std::size_t characters = is_marked ? std::min(kMarked, text.size() / 2) : kUnmarked;
  if (has_zeros(text, 0, characters) || has_zeros(text, 1, characters))
    throw InputError(fmt::format("{}: this text is UTF-16, as PowerShell's \">\" and some editors write it; save it as UTF-8", name));
}

std::string hint_backslash(const std::filesystem::path& file) {
  return file.string().find('\\') == std::string::npos ? "" : "; use / between folders, not \\";
}

}  // namespace carillon::base

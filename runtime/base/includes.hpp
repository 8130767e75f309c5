// Text files that include other files by lines of their own: `*INCLUDE, INPUT=file` (.inp), `INCLUDE 'file'` (Nastran).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace carillon::base {

/// Piece of a joined text: from `begin` up to the next piece it is the text of `file` from `first_line` on.
struct TextOrigin {
  std::size_t begin;
  std::string file;
  std::size_t first_line;
};

struct JoinedText {
  std::string text;
  std::vector<TextOrigin> origins;  // ascending; never empty
};

/// True if a file of this extension may include others: .inp, .bdf, .nas.
bool may_include(const std::filesystem::path& file);

/// The text of `file`, whose content is `bytes`, with every included file in place of its line; names are relative to the including file.
/// Throws InputError "file:line: ...": a missing or unreadable file, a circle, more than `max_bytes` in all.
JoinedText join_includes(const std::filesystem::path& file, std::string bytes, std::uint64_t max_bytes);

/// "file:line" of a position in a text joined from `origins`; without any, in the file `name`.
std::string find_place(std::string_view text, const std::string& name, std::span<const TextOrigin> origins, std::size_t place);

/// Reads `file` and joins it. `what` names it in messages ("mesh file").
JoinedText read_joined(const std::filesystem::path& file, std::string_view what, std::uint64_t max_bytes);

}  // namespace carillon::base

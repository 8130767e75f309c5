// Fields of the lines of CAE files: separated by commas or of fixed width. Internal header of the readers.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/mesh/cursor.hpp"

namespace carillon::mesh {

/// Without blanks at both ends.
std::string_view trim(std::string_view text);
std::string to_upper(std::string_view text);

/// Fields of a line between commas, trimmed; an empty one after a comma at the end is left out.
void split(std::string_view line, std::vector<std::string_view>& fields);

/// Number of a field: also "1.5D+3" and, as Nastran writes it, "7.85-9". InputError at `place` in the file.
double parse_real(const Cursor& cursor, std::size_t place, std::string_view field, const char* what);
std::int64_t parse_int(const Cursor& cursor, std::size_t place, std::string_view field, const char* what);

/// True if the field is a whole number.
bool is_int(std::string_view field);

}  // namespace carillon::mesh

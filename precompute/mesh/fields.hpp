// Fields of the lines of CAE files, with messages. Internal header of the readers.
#pragma once

#include <cstdint>
#include <string_view>

#include "precompute/mesh/cursor.hpp"
#include "runtime/base/fields.hpp"

namespace carillon::mesh {

using base::split;
using base::to_upper;
using base::trim;
using base::unquote;

/// Number of a field. InputError at `place` in the file.
double parse_real(const Cursor& cursor, std::size_t place, std::string_view field, const char* what);
std::int64_t parse_int(const Cursor& cursor, std::size_t place, std::string_view field, const char* what);

/// True if the field is a whole number.
bool is_int(std::string_view field);

}  // namespace carillon::mesh

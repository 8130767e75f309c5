// Fields of the lines of CAE files: separated by commas or of fixed width.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace carillon::base {

/// Without blanks at both ends.
std::string_view trim(std::string_view text);
std::string to_upper(std::string_view text);
/// Without blanks and a pair of single or double quotes around it.
std::string_view unquote(std::string_view text);

/// Fields of a line between commas, trimmed; an empty one after a comma at the end is left out.
void split(std::string_view line, std::vector<std::string_view>& fields);

/// The number of a trimmed field, nullopt if it is none. Also Fortran's "1.5D+3" and Nastran's "7.85-9". May be infinite or NaN.
std::optional<double> find_real(std::string_view field);
std::optional<std::int64_t> find_int(std::string_view field);

}  // namespace carillon::base

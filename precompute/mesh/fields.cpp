#include "precompute/mesh/fields.hpp"

#include <algorithm>
#include <cctype>

namespace carillon::mesh {

double parse_real(const Cursor& cursor, std::size_t place, std::string_view field, const char* what) {
  if (const auto value = base::find_real(field)) return *value;
  cursor.fail(place, "expected {} (a number), found {}; a number is missing or damaged: write the file again", what, quote_excerpt(field));
}

std::int64_t parse_int(const Cursor& cursor, std::size_t place, std::string_view field, const char* what) {
  if (const auto value = base::find_int(field)) return *value;
  cursor.fail(place, "expected {} (a whole number), found {}; a number is missing or damaged: write the file again", what,
              quote_excerpt(field));
}

bool is_int(std::string_view field) {
  if (!field.empty() && (field[0] == '+' || field[0] == '-')) field.remove_prefix(1);
  return !field.empty() && std::all_of(field.begin(), field.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

}  // namespace carillon::mesh

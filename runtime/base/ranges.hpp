// Document values with inclusive bounds; violations are InputError "file:line: ...".
#pragma once

#include <string>
#include <string_view>

#include "runtime/base/document.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::base {

/// Unit of a key by its suffix, after a space: " m" of "length_m"; empty if there is none.
std::string find_unit(std::string_view key);

/// Name of at most 200 bytes without control characters.
std::string read_name(Object& object, std::string_view key);

/// Required number.
double read_within(Object& object, std::string_view key, double low, double high);
/// Optional number; the fallback is not checked.
double read_within(Object& object, std::string_view key, double fallback, double low, double high);
/// Three required numbers.
Vec3 read_vector_within(Object& object, std::string_view key, double low, double high);
/// Three optional numbers of magnitude at most `limit`; the fallback is not checked.
Vec3 read_vector(Object& object, std::string_view key, const Vec3& fallback, double limit);

/// Direction, not normalised and not 0, in which a listener at `position_m` looks: "look_at_m", a point, or "facing", a direction;
/// components up to `limit`.
Vec3 read_facing(Object& listener, const Vec3& position_m, const Vec3& fallback, double limit);

}  // namespace carillon::base

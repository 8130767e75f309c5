// Document values with inclusive bounds; violations are InputError "file:line: ...".
#pragma once

#include <string_view>

#include "runtime/base/document.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::base {

/// Required number.
double read_within(Object& object, std::string_view key, double low, double high);
/// Optional number; the fallback is not checked.
double read_within(Object& object, std::string_view key, double fallback, double low, double high);
/// Three numbers of magnitude at most `limit`.
Vec3 read_vector(Object& object, std::string_view key, const Vec3& fallback, double limit);

}  // namespace carillon::base

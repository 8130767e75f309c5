// Values of a document within bounds, both included. Others are an InputError "file:line: ...".
#pragma once

#include <string_view>

#include "runtime/base/document.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::base {

/// A required number.
double read_within(Object& object, std::string_view key, double low, double high);
/// The same of an optional one; the fallback is not checked.
double read_within(Object& object, std::string_view key, double fallback, double low, double high);
/// Three numbers, each of at most `limit` in size.
Vec3 read_vector(Object& object, std::string_view key, const Vec3& fallback, double limit);

}  // namespace carillon::base

#include "runtime/base/ranges.hpp"

#include <fmt/format.h>

#include <cmath>

namespace carillon::base {

double read_within(Object& object, std::string_view key, double low, double high) {
  const double value = object.number(key);
  if (!(value >= low && value <= high)) object.fail(key, fmt::format("{} is out of range; give a number from {} to {}", value, low, high));
  return value;
}

double read_within(Object& object, std::string_view key, double fallback, double low, double high) {
  return object.has(key) ? read_within(object, key, low, high) : fallback;
}

Vec3 read_vector(Object& object, std::string_view key, const Vec3& fallback, double limit) {
  const Vec3 v = object.numbers_or<3>(key, fallback);
  for (const double x : v)
    if (!(std::abs(x) <= limit)) object.fail(key, fmt::format("{} is out of range; give numbers between {} and {}", x, -limit, limit));
  return v;
}

}  // namespace carillon::base

#include "runtime/base/ranges.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace carillon::base {

std::string find_unit(std::string_view name) {
  static constexpr std::pair<std::string_view, const char*> kUnits[]{
      {"_per_s", " 1/s"},   {"_kg_m3", " kg/m³"}, {"_kg_m2", " kg/m²"}, {"_kg_m", " kg/m"}, {"_m_s2", " m/s²"},
      {"_m_s", " m/s"},     {"_rad_s", " rad/s"}, {"_n_s_m", " N s/m"}, {"_n_m", " N/m"},   {"_n_s", " N s"},
      {"_deg", " degrees"}, {"_hz", " Hz"},       {"_kg", " kg"},       {"_pa", " Pa"},     {"_db", " dB"},
      {"_gb", " GB"},       {"_cents", " cents"}, {"_m", " m"},         {"_s", " s"},       {"_n", " N"}};
  for (const auto& [suffix, unit] : kUnits)
    if (name.ends_with(suffix)) return unit;
  return "";
}

std::string read_name(Object& object, std::string_view key) {
  constexpr std::size_t kMaxBytes = 200;
  std::string name = object.string(key);
  if (name.size() > kMaxBytes || std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }))
    object.fail(key, fmt::format("is not a valid name: at most {} bytes, no control characters", kMaxBytes));
  return name;
}

double read_within(Object& object, std::string_view key, double low, double high) {
  const double value = object.number(key);
  if (!(value >= low && value <= high))
    object.fail(key, fmt::format("{} is out of range; give a number from {} to {}{}", value, low, high, find_unit(key)));
  return value;
}

double read_within(Object& object, std::string_view key, double fallback, double low, double high) {
  return object.has(key) ? read_within(object, key, low, high) : fallback;
}

Vec3 read_vector_within(Object& object, std::string_view key, double low, double high) {
  const Vec3 v = object.numbers<3>(key);
  for (const double x : v)
    if (!(x >= low && x <= high))
      object.fail(key, fmt::format("{} is out of range; give numbers between {} and {}{}", x, low, high, find_unit(key)));
  return v;
}

Vec3 read_vector(Object& object, std::string_view key, const Vec3& fallback, double limit) {
  return object.has(key) ? read_vector_within(object, key, -limit, limit) : fallback;
}

Vec3 read_facing(Object& listener, const Vec3& position_m, const Vec3& fallback, double limit) {
  const bool looks = listener.has("look_at_m");
  if (looks && listener.has("facing")) listener.fail("look_at_m", "says the same thing as \"facing\"; keep one of them");
  const char* key = looks ? "look_at_m" : "facing";
  const Vec3 given = read_vector(listener, key, fallback, limit);
  const Vec3 direction = looks ? given - position_m : given;
  if (!(norm(direction) > 1e-9)) listener.fail(key, "gives the listener no direction to look in; name another place or direction");
  return direction;
}

}  // namespace carillon::base

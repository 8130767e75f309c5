#include "runtime/host/scene_values.hpp"

#include <fmt/format.h>

#include <cmath>

#include "runtime/material/table.hpp"

namespace carillon::host {

Vec3 read_vector(base::Object& object, std::string_view key, const Vec3& fallback, double limit) {
  const Vec3 v = object.numbers_or<3>(key, fallback);
  for (const double x : v) {
    if (!(std::abs(x) <= limit)) object.fail(key, fmt::format("{} is out of range; give numbers between {} and {}", x, -limit, limit));
  }
  return v;
}

Vec3 read_required_vector(base::Object& object, std::string_view key, double limit) {
  if (!object.has(key)) object.numbers<3>(key);  // its message
  return read_vector(object, key, {}, limit);
}

Vec3 read_direction(base::Object& object, std::string_view key) {
  Vec3 v = read_required_vector(object, key);
  const double length = norm(v);
  if (!(length > 1e-9)) object.fail(key, "is no direction; give three numbers that are not all 0");
  for (double& x : v) x /= length;
  return v;
}

double read_within(base::Object& object, std::string_view key, double fallback, double low, double high) {
  const double value = object.number_or(key, fallback);
  if (!(value >= low && value <= high)) {
    object.fail(key, fmt::format("{} is out of range; give a number from {} to {}", value, low, high));
  }
  return value;
}

double read_amount(base::Object& object, std::string_view key, double low, double high) {
  const double value = object.number(key);
  if (!(value >= low && value <= high))
    object.fail(key, fmt::format("{} is out of range; give a number from {:g} to {:g}", value, low, high));
  return value;
}

const material::Material* read_material(base::Object& object, double& young_modulus_pa, double& poisson_ratio) {
  if (!object.has("material")) return nullptr;
  const material::Material& material =
      material::MaterialTable::get().require(object.find_place("material"), object.string("material")).material;
  young_modulus_pa = material.young_modulus_pa;
  poisson_ratio = material.poisson_ratio;
  return &material;
}

}  // namespace carillon::host

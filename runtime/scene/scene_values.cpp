#include "runtime/scene/scene_values.hpp"

#include "runtime/material/table.hpp"

namespace carillon::scene {

Vec3 read_required_vector(base::Object& object, std::string_view key, double limit) {
  return base::read_vector_within(object, key, -limit, limit);
}

Vec3 read_direction(base::Object& object, std::string_view key) {
  Vec3 v = read_required_vector(object, key);
  const double length = norm(v);
  if (!(length > 1e-9)) object.fail(key, "is no direction; give three numbers, not all 0");
  for (double& x : v) x /= length;
  return v;
}

const material::Material* read_material(base::Object& object, double& young_modulus_pa, double& poisson_ratio) {
  if (!object.has("material")) return nullptr;
  const material::Material& material =
      material::MaterialTable::get().require(object.find_place("material"), object.string("material")).material;
  young_modulus_pa = material.young_modulus_pa;
  poisson_ratio = material.poisson_ratio;
  return &material;
}

}  // namespace carillon::scene

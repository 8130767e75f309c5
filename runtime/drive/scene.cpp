#include "runtime/drive/scene.hpp"

#include <algorithm>

#include "runtime/physics/impact/spring.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::drive {

Vec3 Scene::calc_velocity(int body, const Vec3& where) const {
  if (body < 0) return {};
  const Motion& m = motions[body];
  return m.velocity_m_s + cross(m.spin_rad_s, where - m.centre_m);
}

double Scene::calc_inverse_mass(const std::vector<Motion>& at, int a, int b, const Vec3& where, const Vec3& normal) const {
  double sum = 0.0;
  for (const int body : {a, b}) {
    if (body < 0 || bodies[body].fixed) continue;
    const Vec3 arm = cross(where - at[body].centre_m, normal);
    sum += 1.0 / bodies[body].mass_kg + dot(arm, at[body].inverse_inertia * arm);
  }
  return sum;
}

double Scene::calc_size(int a, int b) const {
  const double size = bodies[a].size_m;
  return b >= 0 ? std::min(size, bodies[b].size_m) : size;
}

double Scene::calc_compliance(int a, int b) const {
  const Matter &one = get_matter(a), &other = get_matter(b);
  return impact::calc_contact_compliance(one.young_modulus_pa, one.poisson_ratio, other.young_modulus_pa, other.poisson_ratio);
}

double Scene::calc_contact_radius(int a, int b, double curvature_per_m) const {
  constexpr double kMinM = rigid::kMinContactRadiusM;
  return 1.0 / std::clamp(std::max(curvature_per_m, 0.0), 1.0 / std::max(0.5 * calc_size(a, b), kMinM), 1.0 / kMinM);
}

geometry::Place Scene::find_place(int body, const Vec3& where, const Vec3& outward, std::int32_t hint) const {
  const Mat3 back = transpose(motions[body].rotation);
  const Matter& matter = bodies[body];
  return matter.shape->find_place(matter.centre_m + back * (where - motions[body].centre_m), back * outward, hint);
}

}  // namespace carillon::drive

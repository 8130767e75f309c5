// Rigid bodies as seen by contact sounds: matter, shape and motion of each, whatever engine moves them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/geometry/shape.hpp"

namespace carillon::drive {

/// Constant properties of a body or of the ground.
struct Matter {
  std::uint64_t name_hash = 0;  // seeds ids of contacts; 0: the ground
  double young_modulus_pa = 0.0, poisson_ratio = 0.0, density_kg_m3 = 0.0;
  const geometry::Shape* shape = nullptr;  // not owned; null: the ground, or a silent body
  double size_m = 0.0;                     // diagonal of the bounding box
  bool fixed = false;
  double mass_kg = 0.0;  // unused if fixed
  Vec3 centre_m{};       // of mass, frame of the mesh
};

/// Motion of a body; world axes.
struct Motion {
  Vec3 centre_m{}, velocity_m_s{}, spin_rad_s{};
  Mat3 rotation{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};  // of the mesh frame
  Mat3 inverse_inertia{};                                      // about the centre; zero if fixed
  bool is_still = false;                                       // fixed or asleep
};

/// All bodies and the ground (body -1) at one time. `motions`: one per body.
struct Scene {
  std::vector<Matter> bodies;
  Matter ground;
  std::vector<Motion> motions;
  double time_s = 0.0;
  double before_s = 0.0;  // start of the step or window that ends at time_s

  const Matter& get_matter(int body) const { return body < 0 ? ground : bodies[body]; }
  bool is_still(int body) const { return body < 0 || motions[body].is_still; }
  /// Velocity of a body at a point [m/s]; zero for the ground.
  Vec3 calc_velocity(int body, const Vec3& where) const;
  /// 1/m_eff of two bodies along a unit vector at a point [1/kg]; poses of `at`, one per body.
  double calc_inverse_mass(const std::vector<Motion>& at, int a, int b, const Vec3& where, const Vec3& normal) const;
  /// Size of the smaller one [m].
  double calc_size(int a, int b) const;
  /// Maximum distance of points of a pair in one spot [m]: a tenth of that size.
  double calc_spot_radius(int a, int b) const { return 0.1 * calc_size(a, b); }
  /// 1/E* [1/Pa].
  double calc_compliance(int a, int b) const;
  /// Radius of a Hertz contact [m] of the summed curvature, between 0.5 mm and half the smaller size.
  double calc_contact_radius(int a, int b, double curvature_per_m) const;
  /// Position of a world point on a body's mesh, whose surface faces `outward` there; `hint`: a likely triangle. The body must have a
  /// shape.
  geometry::Place find_place(int body, const Vec3& where, const Vec3& outward, std::int32_t hint = -1) const;
};

}  // namespace carillon::drive

// Silent bodies: banks of a surface, a mass and moduli without modes. They collide and do not vibrate.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::exchange {

/// Closed, outward.
struct Surface {
  std::vector<Vec3> vertices_m;
  std::vector<Triangle> triangles;
};

/// About the origin. Cylinders and capsules along y, one of their radii may be 0; the height of a capsule is that between the centres of
/// its spheres (KHR_implicit_shapes). Round ones have vertices on the true surface.
Surface make_box(const Vec3& size_m);
Surface make_sphere(double radius_m);
Surface make_cylinder(double height_m, double bottom_m, double top_m);
Surface make_capsule(double height_m, double bottom_m, double top_m);

/// Joins vertices at one place, removes triangles without area between them and vertices without triangles.
void weld(Surface& surface);

/// A Wavefront file: polygons become fans. Throws InputError "name:line: ...".
Surface parse_obj_surface(std::string_view bytes, const std::string& name);

struct SilentBody {
  Surface surface;
  std::optional<double> mass_kg{};  // else by density
  double density_kg_m3 = 2400.0;
  double young_modulus_pa = 30e9, poisson_ratio = 0.2;   // concrete, as GroundSpec
  std::optional<Vec3> centre_m{};                        // else, and if outside, of the surface filled evenly
  std::optional<std::array<double, 9>> inertia_kg_m2{};  // about the centre; else, and if it contradicts the surface, of that
  std::string origin;                                    // for the record
};

/// Throws InputError for an open or inward-facing surface. `warnings`: those of settle_rigid() are appended.
bank::Bank make_silent_bank(const SilentBody& body, std::vector<std::string>& warnings);

}  // namespace carillon::exchange

// Solids of wood for the tests of this folder.
#pragma once

#include <algorithm>
#include <cstddef>

#include "runtime/physics/rigid/space.hpp"
#include "tests/unit/runtime/physics/geometry/solids.hpp"

namespace carillon::rigid {

/// A solid of a given mass with the inertia of a box of such sides.
inline Solid make_solid(const geometry::tests::Solid& from, double mass_kg, const Vec3& sides) {
  Solid s;
  s.shape = from.make();
  s.mass_kg = mass_kg;
  s.restitution = 0.2;
  s.friction = 0.4;
  s.young_modulus_pa = 10e9;
  s.poisson_ratio = 0.3;
  for (std::size_t k = 0; k < 3; ++k) {
    const double u = sides[(k + 1) % 3], v = sides[(k + 2) % 3], inertia = mass_kg * (u * u + v * v) / 12.0;
    s.inertia_kg_m2[k][k] = inertia;
    s.inverse_inertia[k][k] = 1.0 / inertia;
  }
  for (const Vec3& x : from.vertices) s.radius_m = std::max(s.radius_m, norm(x));
  return s;
}

inline Solid make_box(double mass_kg, const Vec3& sides) { return make_solid(geometry::tests::make_box(sides, 1), mass_kg, sides); }

}  // namespace carillon::rigid

// Volume integrals of a closed surface, and the rigid body that it encloses.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::exchange {

struct Solid {
  double volume_m3 = 0.0;
  Vec3 centre_m{};
  std::array<double, 9> inertia_m5{};  // unit density, about the centre
};

/// Triangles face outward. Tonon 2004.
Solid calc_solid(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles);

/// Sets volume, centre and inertia of a body of mass rigid.mass_kg: those given, else those of its surface filled evenly, `solid`. The
/// latter also with a warning instead of a centre outside the surface, and of a tensor (3, 3) about the centre that no solid has or that
/// differs by more than 5 % about any axis.
void settle_rigid(const std::optional<Vec3>& centre_m, const std::optional<std::array<double, 9>>& inertia_kg_m2, const Solid& solid,
                  bank::Bank& bank, std::vector<std::string>& warnings);

}  // namespace carillon::exchange

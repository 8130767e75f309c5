// Volume integrals of a closed surface.
#pragma once

#include <array>
#include <vector>

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

}  // namespace carillon::exchange

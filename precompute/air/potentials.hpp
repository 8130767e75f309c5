// Closed-form potentials of a flat triangle with a linear density.
#pragma once

#include <array>

#include "runtime/base/vector.hpp"

namespace carillon::air {

/// Integrals over a triangle at a point x, R = |x - y|, without the factor 1 / 4 pi. lambda_c: hat function of corner c.
struct Potentials {
  double constant = 0.0;                 // integral of 1 / R [m]
  std::array<double, 3> single{};        // integral of lambda_c / R
  std::array<Vec3, 3> gradient{};        // gradient of `single` by x [1]
  std::array<double, 3> double_layer{};  // integral of lambda_c d(1 / R) / dn_y [1]; 0 in the plane of the triangle
};

/// Pre: the point is not on an edge. In the plane of the triangle the normal component of the gradient is the mean of both sides, 0. At a
/// distance of 1e-7 edges from the line of an edge the error is still 1e-7 of the largest value. D. Wilton et al., IEEE Trans. AP-32 (1984)
/// 276; R. Graglia, IEEE Trans. AP-41 (1993) 1448.
Potentials calc_potentials(const std::array<Vec3, 3>& corners_m, const Vec3& normal, const std::array<Vec3, 3>& curl, const Vec3& x_m);

}  // namespace carillon::air

#include "runtime/exchange/solid.hpp"

#include <Eigen/Dense>

namespace carillon::exchange {

Solid calc_solid(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles) {
  Solid solid;
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();  // integral of x x^T
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  for (const auto& triangle : triangles) {
    Eigen::Matrix3d p;
    for (int c = 0; c < 3; ++c) p.col(c) = Eigen::Map<const Eigen::Vector3d>(vertices_m[triangle[c]].data());
    const double part = p.determinant() / 6.0;  // tetrahedron with the origin
    const Eigen::Vector3d sum = p.rowwise().sum();
    solid.volume_m3 += part;
    first += part / 4.0 * sum;
    second += part / 20.0 * (sum * sum.transpose() + p * p.transpose());
  }
  const Eigen::Vector3d centre = first / solid.volume_m3;
  const Eigen::Matrix3d about = second - solid.volume_m3 * centre * centre.transpose();
  const Eigen::Matrix3d inertia = about.trace() * Eigen::Matrix3d::Identity() - about;
  for (std::size_t c = 0; c < 3; ++c) solid.centre_m[c] = centre[static_cast<int>(c)];
  for (std::size_t i = 0; i < 9; ++i) solid.inertia_m5[i] = inertia(static_cast<int>(i / 3), static_cast<int>(i % 3));
  return solid;
}

}  // namespace carillon::exchange

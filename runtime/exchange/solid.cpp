#include "runtime/exchange/solid.hpp"

#include <Eigen/Dense>

#include "runtime/bank/surface.hpp"

namespace carillon::exchange {
namespace {

constexpr double kInertiaTolerance = 0.05;  // largest relative difference about any axis

/// Takes a tensor in place of that of a surface; false if it contradicts it.
bool take_inertia(const std::array<double, 9>& given, std::array<double, 9>& of_surface) {
  const Eigen::Map<const Eigen::Matrix3d> tensor(given.data());  // symmetric
  Eigen::Map<Eigen::Matrix3d> surface(of_surface.data());
  const Eigen::Matrix3d about = 0.5 * tensor.trace() * Eigen::Matrix3d::Identity() - tensor;
  const Eigen::LLT<Eigen::Matrix3d> root(surface);
  if (!tensor.allFinite() || root.info() != Eigen::Success) return false;
  // Moments about all axes at once: the eigenvalues of L^-1 (given - surface) L^-T.
  Eigen::Matrix3d difference = tensor - surface;
  root.matrixL().solveInPlace(difference);
  difference.transposeInPlace();
  root.matrixL().solveInPlace(difference);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(0.5 * (difference + difference.transpose()), Eigen::EigenvaluesOnly);
  const bool is_possible = Eigen::LLT<Eigen::Matrix3d>(about).info() == Eigen::Success;
  if (!is_possible || !(solver.eigenvalues().cwiseAbs().maxCoeff() <= kInertiaTolerance)) return false;
  surface = tensor;
  return true;
}

}  // namespace

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

void settle_rigid(const std::optional<Vec3>& centre_m, const std::optional<std::array<double, 9>>& inertia_kg_m2, const Solid& solid,
                  bank::Bank& bank, std::vector<std::string>& warnings) {
  bank::RigidBody& rigid = bank.rigid;
  rigid.volume_m3 = solid.volume_m3;
  rigid.centre_m = centre_m.value_or(solid.centre_m);
  const auto [low, high] = bank::find_extent(bank.vertices_m);
  for (std::size_t c = 0; c < 3; ++c)
    if (!(rigid.centre_m[c] > low[c] && rigid.centre_m[c] < high[c])) {
      warnings.emplace_back("its centre of mass lies outside its surface; that of the surface, filled evenly, is taken");
      rigid.centre_m = solid.centre_m;
      break;
    }
  for (std::size_t i = 0; i < 9; ++i) rigid.inertia_kg_m2[i] = rigid.mass_kg / solid.volume_m3 * solid.inertia_m5[i];
  if (inertia_kg_m2 && !take_inertia(*inertia_kg_m2, rigid.inertia_kg_m2))
    warnings.emplace_back("its moments of inertia contradict its surface and its mass; those of the surface, filled evenly, are taken");
}

}  // namespace carillon::exchange

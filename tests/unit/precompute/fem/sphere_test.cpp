// A free solid sphere against Lamb's frequency equations (Lamb 1882; Eringen and Suhubi 1975, "Elastodynamics" vol. 2, section 8.14),
// solved here by bisection with the standard library's Bessel functions. mu = rho = radius = 1, so omega a / c_T is omega itself.
#include <gtest/gtest.h>

#include <cmath>

#include "precompute/fem/assemble.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/lamb.hpp"
#include "tests/support/subspace.hpp"

namespace carillon::fem {
namespace {

using tests::find_s2;
using tests::kT2;

/// The first ten elastic modes: five times T2, five times S2.
std::vector<double> calc_modes(const mesh::TetMesh& mesh, double nu, Form form) {
  material::Material material;
  material.young_modulus_pa = 2 * (1 + nu);
  material.poisson_ratio = nu;
  material.density_kg_m3 = 1;
  const mesh::DistributedMesh pieces = mesh::distribute(PETSC_COMM_WORLD, mesh, {});
  const System system = assemble(PETSC_COMM_WORLD, pieces.local, material, job::Mass::consistent, form);
  const auto pairs = tests::iterate_subspace(tests::copy(system.stiffness), tests::copy(system.mass), 16, 4, 20);
  std::vector<double> omega;
  for (int i = 6; i < 16; ++i) omega.push_back(std::sqrt(pairs.lambda[i]));
  return omega;
}

mesh::TetMesh make_ball(double edge_m) {
  shapes::ShapeOptions options;
  options.shape = "sphere";
  options.dimensions = {{"radius", 1.0}};
  options.order = 2;
  options.edge_m = edge_m;
  return shapes::make_shape(options);
}

/// The largest relative error of T2 and of S2.
std::array<double, 2> calc_errors(const mesh::TetMesh& mesh, double nu, Form form) {
  const auto omega = calc_modes(mesh, nu, form);
  std::array<double, 2> worst{};
  const std::array<double, 2> exact{kT2, find_s2(nu)};
  for (int i = 0; i < 10; ++i) worst[i / 5] = std::max(worst[i / 5], std::abs(omega[i] / exact[i / 5] - 1));
  return worst;
}

TEST(LambsEquation, has_the_published_roots) {
  EXPECT_NEAR(find_s2(0.25), 2.6398692779019, 1e-12);
  EXPECT_NEAR(find_s2(0.0), 2.592038804114, 1e-11);
}

TEST(NearlyIncompressibleSphere, is_as_exact_as_a_compressible_one_with_T10) {
  const auto ball = make_ball(0.45);
  const auto usual = calc_errors(ball, 0.3, Form::automatic);
  for (const double nu : {0.45, 0.49, 0.499, 0.4999}) {
    const auto errors = calc_errors(ball, nu, Form::automatic);
    EXPECT_LT(errors[0], 2 * usual[0]) << nu;
    EXPECT_LT(errors[1], 2 * usual[1]) << nu;
  }
}

TEST(NearlyIncompressibleSphere, would_lock_without_mean_dilatation) {
  const auto errors = calc_errors(make_ball(0.45), 0.4999, Form::displacement);
  EXPECT_GT(errors[0], 0.005);
  EXPECT_GT(errors[1], 0.02);
}

TEST(CurvedSides, take_the_error_of_a_ball_to_the_fourth_order_and_straight_ones_keep_it_at_the_second) {
  std::array<std::array<double, 2>, 2> error{};  // straight, curved; coarse, fine
  std::array<double, 2> size{};
  for (int fine = 0; fine < 2; ++fine) {
    const auto ball = make_ball(fine == 0 ? 0.8 : 0.45);
    size[fine] = std::cbrt(1.0 / static_cast<double>(ball.tet_count()));
    error[1][fine] = calc_errors(ball, 0.3, Form::automatic)[1];
    error[0][fine] = calc_errors(mesh::to_quadratic(mesh::to_linear(ball)), 0.3, Form::automatic)[1];
  }
  const auto order = [&](int curved) { return std::log(error[curved][0] / error[curved][1]) / std::log(size[0] / size[1]); };
  EXPECT_NEAR(order(0), 2, 0.4) << error[0][0] << " " << error[0][1];
  EXPECT_GT(order(1), 3.3) << error[1][0] << " " << error[1][1];
  EXPECT_GT(error[0][1], 10 * error[1][1]);
}

}  // namespace
}  // namespace carillon::fem

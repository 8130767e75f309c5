// A box on rollers (normal displacement and tangential traction zero on all six faces) has smooth closed-form modes, suited to measure the
// order of convergence: f = c/2 sqrt((i/a)^2 + (j/b)^2 + (k/c)^2), c = c_L with any index, c = c_T with two or three (Demarest 1971;
// verified by substitution). The conditions fix single directions, which jobs do not support, so the free K and M are reduced here and
// solved with Eigen.
#include <gtest/gtest.h>

#include <cmath>

#include "precompute/fem/assemble.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/subspace.hpp"

namespace carillon::fem {
namespace {

constexpr std::array<double, 3> kSize{0.3, 0.2, 0.1};
const material::Material kAluminium{
    .young_modulus_pa = 70e9, .poisson_ratio = 0.33, .density_kg_m3 = 2700, .alpha1_s = 0, .alpha2_per_s = 0};

std::vector<double> calc_frequencies(std::array<int, 3> cells, int order, job::Mass mass) {
  const mesh::DistributedMesh pieces = mesh::distribute(PETSC_COMM_WORLD, tests::make_box(cells, kSize, order), {});
  const System system = assemble(PETSC_COMM_WORLD, pieces.local, kAluminium, mass);
  std::vector<int> number;
  int size = 0;
  for (int i = 0; i < pieces.local.free_nodes; ++i)
    for (int d = 0; d < 3; ++d) {
      const double x = pieces.local.nodes_m[i][d];
      number.push_back(x > 1e-12 && x < kSize[d] - 1e-12 ? size++ : -1);
    }
  const auto pairs = tests::iterate_subspace(tests::reduce(system.stiffness, number, size), tests::reduce(system.mass, number, size), 6);
  std::vector<double> frequencies;
  for (const double lambda : pairs.lambda) frequencies.push_back(std::sqrt(lambda) / (2 * M_PI));
  return frequencies;
}

constexpr double kS110 = 9380.300465361, kP100 = 10329.70716337, kS210 = 13008.13627197;

double order_of_convergence(std::array<int, 3> coarse, int order, double exact, int mode) {
  const double first = calc_frequencies(coarse, order, job::Mass::consistent)[mode] / exact - 1;
  for (int& n : coarse) n *= 2;
  const double second = calc_frequencies(coarse, order, job::Mass::consistent)[mode] / exact - 1;
  EXPECT_GT(second, 0) << "a conforming element is too stiff";
  return std::log2(first / second);
}

TEST(BoxOnRollers, has_its_first_modes_with_T10_to_a_thousandth) {
  const auto f = calc_frequencies({9, 6, 3}, 2, job::Mass::consistent);
  EXPECT_NEAR(f[0] / kS110, 1, 1e-3);
  EXPECT_NEAR(f[1] / kP100, 1, 1e-3);
  EXPECT_NEAR(f[2] / kS210, 1, 2e-3);
}

TEST(BoxOnRollers, converges_with_the_second_order_for_T4) { EXPECT_NEAR(order_of_convergence({6, 4, 2}, 1, kS110, 0), 2, 0.15); }

TEST(BoxOnRollers, converges_with_the_fourth_order_for_T10) { EXPECT_NEAR(order_of_convergence({6, 4, 2}, 2, kS110, 0), 4, 0.3); }

TEST(BoxOnRollers, converges_from_below_with_lumped_T10) {
  const auto f = calc_frequencies({6, 4, 2}, 2, job::Mass::lumped);
  EXPECT_LT(f[0], kS110);
  EXPECT_NEAR(f[0] / kS110, 1, 0.02);
}

}  // namespace
}  // namespace carillon::fem

// Scaled element strains: their products are the stiffness matrix for every element and material.
#include "precompute/coupling/strains.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "precompute/coupling/choose.hpp"
#include "precompute/coupling/points.hpp"
#include "precompute/fem/element.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "tests/unit/precompute/coupling/bodies.hpp"

namespace carillon::coupling {
namespace {

material::Material make_wood() {
  material::Material wood;
  wood.density_kg_m3 = 400;
  wood.orthotropic = material::Orthotropic{};
  wood.orthotropic->young_modulus_pa = {12e9, 0.8e9, 0.5e9};
  wood.orthotropic->shear_modulus_pa = {0.05e9, 0.7e9, 0.75e9};
  wood.orthotropic->poisson_ratio = {0.4, 0.35, 0.4};
  wood.orthotropic->axes = {{{0.6, 0.8, 0}, {-0.8, 0.6, 0}}};
  return wood;
}

/// Largest difference of B^T B from fem's stiffness, relative to the largest entry.
double compare(const std::string& shape, int order, const material::Material& material) {
  shapes::ShapeOptions options{.shape = shape};
  options.order = order;
  options.target_nodes = 600;
  const mesh::DistributedMesh pieces = mesh::distribute(PETSC_COMM_SELF, shapes::make_shape(options), {});
  const fem::Materials materials(material);
  const fem::Solid solid(material);
  const Strains strains(pieces.local, materials);
  double worst = 0;
  ElementPoints points;
  RowMatrix b;
  for (std::int32_t e = 0; e < strains.element_count(); ++e) {
    std::vector<Vec3> x;
    for (const std::int32_t node : strains.nodes(e)) x.push_back(pieces.local.nodes_m[node]);
    fem::ElementMatrices expected;
    EXPECT_TRUE(fem::calc_element(x, solid, job::Mass::consistent, expected));
    const Eigen::Index n = 3 * expected.nodes;
    const Eigen::Map<const RowMatrix> k(expected.stiffness.data(), n, n);
    strains.calc_points(e, points);
    strains.calc_linear(e, points, b);
    worst = std::max(worst, (b.transpose() * b - k).cwiseAbs().maxCoeff() / k.cwiseAbs().maxCoeff());
  }
  return worst;
}

TEST(Strains, multiply_to_the_stiffness_of_every_element) {
  const material::Material steel = tests::make_solid(200e9, 0.3, 7800), rubber = tests::make_solid(1e7, 0.499, 1100);
  for (const material::Material& material : {steel, rubber, make_wood()})
    for (const int order : {1, 2})
      for (const char* shape : {"bar", "sphere"}) EXPECT_LT(compare(shape, order, material), 1e-12) << shape << order;
}

TEST(ChooseModes, takes_the_lowest_that_bend_and_keeps_pairs_together) {
  const std::vector<double> freq{100, 200, 200, 300, 400, 500}, slenderness{9, 9, 9, 1, 9, 9};
  const std::vector<std::int32_t> all{0, 1, 2, 3, 4, 5};
  const Choice four = choose_modes(freq, slenderness, all, 4, 450);
  EXPECT_EQ(four.modes, (std::vector<std::int32_t>{0, 1, 2, 4}));
  EXPECT_EQ(four.bending_count, 4);
  EXPECT_DOUBLE_EQ(four.membrane_hz, 300);
  EXPECT_DOUBLE_EQ(four.top_hz, 400);
  const Choice two = choose_modes(freq, slenderness, all, 2, 450);
  EXPECT_EQ(two.modes, (std::vector<std::int32_t>{0}));
  EXPECT_TRUE(two.splits_pair);
}

TEST(SolveNonnegative, finds_the_weights_that_made_the_right_side) {
  la::Matrix a(6, 5);
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 5; ++j) a(i, j) = std::cos(1.3 * i * j + j);
  la::Vector x(5);
  x << 2, 0, 0.5, 0, 1;
  EXPECT_LT((solve_nonnegative(a, a * x, 1e-12, 5) - x).norm(), 1e-9);
}

TEST(SolveNonnegative, leaves_at_zero_what_would_be_negative) {
  // The least-squares solution is (2, -1); the best one with x >= 0 is (1, 0).
  la::Matrix a(2, 2);
  a << 1, 1, 0, 1;
  la::Vector b(2);
  b << 1, -1;
  const la::Vector x = solve_nonnegative(a, b, 1e-12, 2);
  EXPECT_NEAR(x[0], 1, 1e-12);
  EXPECT_EQ(x[1], 0);
}

}  // namespace
}  // namespace carillon::coupling

// Elements at rest: gradients, masses, critical steps. Oracles: closed forms and integrals of polynomials.
#include "precompute/simulation/transient/element.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <numbers>

#include "tests/unit/precompute/simulation/transient/bodies.hpp"

namespace carillon::transient {
namespace {

std::vector<Vec3> make_t10(const std::array<Vec3, 4>& corners) {
  std::vector<Vec3> x(corners.begin(), corners.end());
  for (const auto& edge : mesh::kEdges) x.push_back(0.5 * (x[edge[0]] + x[edge[1]]));
  return x;
}
const std::array<Vec3, 4> kCorners{Vec3{0.1, 0.0, 0.2}, Vec3{1.3, 0.2, 0.1}, Vec3{0.2, 1.1, 0.0}, Vec3{0.3, 0.2, 0.9}};

TEST(Element, barycentric_gradients) {
  ElementShape shape;
  ASSERT_TRUE(make_shape(Kind::kT4, kCorners, shape));
  Eigen::Matrix3d edges;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 3; ++i) edges(i, k) = kCorners[k + 1][i] - kCorners[0][i];
  const Eigen::Matrix3d inverse = edges.inverse();
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(shape.gradient[0][k][j], inverse(static_cast<int>(k), static_cast<int>(j)), 1e-14);
  EXPECT_NEAR(shape.weight_m3[0], edges.determinant() / 6.0, 1e-15);
}

TEST(Element, straight_and_curved_rules) {
  const std::vector<Vec3> x = make_t10(kCorners);
  EXPECT_FALSE(is_curved(x));
  ElementShape straight, curved;
  ASSERT_TRUE(make_shape(Kind::kT10, x, straight));
  ASSERT_TRUE(make_shape(Kind::kCurvedT10, x, curved));
  for (std::size_t q = 0; q < 4; ++q) {
    EXPECT_NEAR(curved.weight_m3[q], straight.weight_m3[q], 1e-15);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_LT(norm(curved.gradient[q][k] - straight.gradient[q][k]), 1e-14);
  }
  for (std::size_t a = 0; a < 10; ++a) EXPECT_NEAR(curved.lumped_m3[a], straight.lumped_m3[a], 1e-14) << a;
}

// The map of a corner tetrahedron x -> x + c x y stretches volumes
// by det = 1 + c y, whose integral over the unit tetrahedron is 1/6 + c/24.
TEST(Element, curved_mass) {
  const double c = 0.3;
  std::vector<Vec3> x = make_t10({Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}});
  for (Vec3& p : x) p[0] += c * p[0] * p[1];
  EXPECT_TRUE(is_curved(x));
  ElementShape shape;
  ASSERT_TRUE(make_shape(Kind::kCurvedT10, x, shape));
  double sum = 0.0;
  for (const double share : shape.lumped_m3) {
    EXPECT_GT(share, 0.0);
    sum += share;
  }
  EXPECT_NEAR(sum, 1.0 / 6.0 + c / 24.0, 1e-15);
}

TEST(Element, inverted_element) {
  ElementShape shape;
  EXPECT_FALSE(make_shape(Kind::kT4, std::vector<Vec3>{kCorners[1], kCorners[0], kCorners[2], kCorners[3]}, shape));
  std::vector<Vec3> x = make_t10({Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}});
  x[4] = {0.5, 0.6, 0.6};
  x[6] = {0.7, 0.1, 0.5};
  x[7] = {0.9, 0.5, 0.3};
  EXPECT_FALSE(make_shape(Kind::kCurvedT10, x, shape));
}

// Single T4, from the stiffness V B^T D B by Eigen.
TEST(Element, highest_frequency_of_one_tetrahedron) {
  ElementShape shape;
  ASSERT_TRUE(make_shape(Kind::kT4, kCorners, shape));
  const Law law = testing::make_law(70e9, 0.3, 2700);
  Eigen::Matrix<double, 6, 12> b = Eigen::Matrix<double, 6, 12>::Zero();
  for (int a = 0; a < 4; ++a) {
    Vec3 g = a == 0 ? -1.0 * (shape.gradient[0][0] + shape.gradient[0][1] + shape.gradient[0][2]) : shape.gradient[0][a - 1];
    for (int i = 0; i < 3; ++i) b(i, 3 * a + i) = g[i];
    b(3, 3 * a + 1) = b(4, 3 * a) = g[2];
    b(3, 3 * a + 2) = b(5, 3 * a) = g[1];
    b(4, 3 * a + 2) = b(5, 3 * a + 1) = g[0];
  }
  Eigen::Matrix<double, 6, 6> d = Eigen::Matrix<double, 6, 6>::Zero();
  d.topLeftCorner<3, 3>().setConstant(law.lambda_pa);
  for (int i = 0; i < 6; ++i) d(i, i) += i < 3 ? 2.0 * law.mu_pa : law.mu_pa;
  const Eigen::MatrixXd k = shape.weight_m3[0] * b.transpose() * d * b;
  const double mass = law.density_kg_m3 * shape.weight_m3[0] / 4.0;
  const double highest = std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(k / mass).eigenvalues().maxCoeff());
  EXPECT_NEAR(calc_omega(shape, law) / highest, 1.0, 0.02);
}

}  // namespace
}  // namespace carillon::transient

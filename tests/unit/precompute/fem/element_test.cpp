// Element matrices against fields of known energy, and against an independent quadrature: shape functions from a Vandermonde matrix,
// derivatives by central differences (exact for quadratics), Gauss-Legendre points by Newton's iteration.
#include "precompute/fem/element.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace carillon::fem {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

const material::Material kMaterial{
    .young_modulus_pa = 70e9, .poisson_ratio = 0.33, .density_kg_m3 = 2700, .alpha1_s = 0, .alpha2_per_s = 0};

const std::vector<Vec3> kTet{{0.1, -0.2, 0.05}, {1.3, 0.1, 0.2}, {0.2, 0.9, -0.1}, {0.3, 0.2, 1.1}};

std::vector<Vec3> make_t10(double bulge) {
  std::vector<Vec3> x = kTet;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> push(-bulge, bulge);
  for (const auto& [a, b] : mesh::kEdges) {
    Vec3 middle;
    for (int k = 0; k < 3; ++k) middle[k] = (kTet[a][k] + kTet[b][k]) / 2 + (bulge > 0 ? push(random) : 0);
    x.push_back(middle);
  }
  return x;
}

double calc_volume(const std::vector<Vec3>& x) {
  Matrix3d edges;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) edges(i, k) = x[i + 1][k] - x[0][k];
  return edges.determinant() / 6;
}

using Field = std::function<Vector3d(const Vector3d&)>;

VectorXd sample(const std::vector<Vec3>& x, const Field& field) {
  VectorXd u(3 * x.size());
  for (std::size_t i = 0; i < x.size(); ++i) u.segment<3>(3 * i) = field({x[i][0], x[i][1], x[i][2]});
  return u;
}

Eigen::MatrixXd stiffness(const ElementMatrices& e) {
  return Eigen::Map<const Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(e.stiffness.data(), 3 * e.nodes, 3 * e.nodes);
}

Eigen::MatrixXd mass(const ElementMatrices& e) {
  return Eigen::Map<const Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(e.mass.data(), e.nodes, e.nodes);
}

double energy_density(const Matrix3d& gradient) {
  const Matrix3d strain = (gradient + gradient.transpose()) / 2;
  const double lambda = kMaterial.lame_lambda_pa(), mu = kMaterial.lame_mu_pa();
  return lambda / 2 * std::pow(strain.trace(), 2) + mu * strain.squaredNorm();
}

/// Gauss-Legendre on [0, 1] by Newton's iteration on the Legendre polynomial.
std::vector<std::pair<double, double>> make_gauss(int n) {
  std::vector<std::pair<double, double>> rule;
  for (int i = 0; i < n; ++i) {
    double x = std::cos(std::numbers::pi * (i + 0.75) / (n + 0.5)), slope = 0;
    for (int pass = 0; pass < 50; ++pass) {
      double p0 = 1, p1 = x;
      for (int k = 2; k <= n; ++k) std::tie(p0, p1) = std::pair(p1, ((2 * k - 1) * x * p1 - (k - 1) * p0) / k);
      slope = n * (x * p1 - p0) / (x * x - 1);
      x -= p1 / slope;
    }
    rule.emplace_back((1 + x) / 2, 1 / ((1 - x * x) * slope * slope));
  }
  return rule;
}

/// Integrates f over the unit tetrahedron in (a, b, c).
double integrate(int n, const std::function<double(const Vector3d&)>& f) {
  double sum = 0;
  const auto gauss = make_gauss(n);
  for (const auto& [u, wu] : gauss)
    for (const auto& [v, wv] : gauss)
      for (const auto& [w, ww] : gauss) sum += wu * wv * ww * (1 - w) * (1 - w) * (1 - v) * f({u * (1 - v) * (1 - w), v * (1 - w), w});
  return sum;
}

/// Quadratic interpolation of ten nodal values in monomials.
class Interpolant {
 public:
  explicit Interpolant(const Eigen::MatrixXd& values /* (10, 3) */) {
    Eigen::Matrix<double, 10, 10> at_nodes;
    const std::vector<Vector3d> corner{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int i = 0; i < 10; ++i)
      at_nodes.row(i) = monomials(i < 4 ? corner[i] : Vector3d((corner[mesh::kEdges[i - 4][0]] + corner[mesh::kEdges[i - 4][1]]) / 2));
    coefficients_ = at_nodes.fullPivLu().solve(values);
  }
  Vector3d at(const Vector3d& p) const { return (monomials(p) * coefficients_).transpose(); }
  Matrix3d slope(const Vector3d& p) const {  // column d: derivative along d; central differences are exact for quadratics
    Matrix3d result;
    for (int d = 0; d < 3; ++d) result.col(d) = (at(p + 0.5 * Vector3d::Unit(d)) - at(p - 0.5 * Vector3d::Unit(d)));
    return result;
  }

 private:
  static Eigen::Matrix<double, 1, 10> monomials(const Vector3d& p) {
    Eigen::Matrix<double, 1, 10> m;
    m << 1, p[0], p[1], p[2], p[0] * p[0], p[1] * p[1], p[2] * p[2], p[0] * p[1], p[1] * p[2], p[0] * p[2];
    return m;
  }
  Eigen::MatrixXd coefficients_;
};

Eigen::MatrixXd as_rows(const std::vector<Vec3>& x) {
  Eigen::MatrixXd rows(x.size(), 3);
  for (std::size_t i = 0; i < x.size(); ++i) rows.row(i) << x[i][0], x[i][1], x[i][2];
  return rows;
}

VectorXd random_vector(int n, int seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  VectorXd v(n);
  for (double& value : v) value = normal(random);
  return v;
}

class Elements : public testing::TestWithParam<double> {  // bulge of the mid-side nodes; negative: T4
 protected:
  std::vector<Vec3> x() const { return GetParam() < 0 ? kTet : make_t10(GetParam()); }
};

TEST_P(Elements, give_no_force_under_the_six_rigid_motions) {
  ElementMatrices element;
  ASSERT_TRUE(calc_element(x(), kMaterial, job::Mass::consistent, element));
  const Eigen::MatrixXd k = stiffness(element);
  for (int motion = 0; motion < 6; ++motion) {
    const Vector3d axis = Vector3d::Unit(motion % 3);
    const VectorXd u = sample(x(), [&](const Vector3d& p) -> Vector3d { return motion < 3 ? axis : axis.cross(p); });
    EXPECT_LT((k * u).norm(), 1e-12 * k.norm() * u.norm()) << motion;
  }
}

TEST_P(Elements, hold_exactly_the_energy_of_a_uniform_strain) {
  ElementMatrices element;
  ASSERT_TRUE(calc_element(x(), kMaterial, job::Mass::consistent, element));
  Matrix3d gradient;
  gradient << 1e-3, 2e-3, -5e-4, 3e-4, -7e-4, 1e-3, 2e-4, 0, 4e-4;
  const VectorXd u = sample(x(), [&](const Vector3d& p) -> Vector3d { return gradient * p; });
  double volume = calc_volume(x());
  if (GetParam() > 0) {
    const Interpolant shape(as_rows(x()));
    volume = integrate(6, [&](const Vector3d& p) { return shape.slope(p).determinant(); });
  }
  const double expected = energy_density(gradient) * volume;
  EXPECT_NEAR(0.5 * u.dot(stiffness(element) * u), expected, 1e-12 * expected);
}

TEST_P(Elements, carry_exactly_their_mass_in_a_translation_consistent_and_lumped) {
  const ElementMoments moments = calc_moments(x(), kMaterial.density_kg_m3);
  for (const auto kind : {job::Mass::consistent, job::Mass::lumped}) {
    ElementMatrices element;
    ASSERT_TRUE(calc_element(x(), kMaterial, kind, element));
    EXPECT_NEAR(mass(element).sum(), moments.mass_kg, 1e-12 * moments.mass_kg);
  }
  if (GetParam() <= 0) {
    EXPECT_NEAR(moments.mass_kg, 2700 * calc_volume(kTet), 1e-10);
  }
}

TEST_P(Elements, have_lumped_masses_that_are_positive_and_on_the_diagonal) {
  ElementMatrices element;
  ASSERT_TRUE(calc_element(x(), kMaterial, job::Mass::lumped, element));
  const Eigen::MatrixXd m = mass(element);
  EXPECT_GT(m.diagonal().minCoeff(), 0);
  EXPECT_EQ((m - Eigen::MatrixXd(m.diagonal().asDiagonal())).norm(), 0);
  if (GetParam() < 0) {
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(m(i, i), m.sum() / 4, 1e-12 * m.sum());
  }
}

TEST_P(Elements, have_symmetric_matrices_with_six_zero_and_else_positive_stiffnesses) {
  ElementMatrices element;
  ASSERT_TRUE(calc_element(x(), kMaterial, job::Mass::consistent, element));
  const Eigen::MatrixXd k = stiffness(element), m = mass(element);
  EXPECT_EQ((k - k.transpose()).norm(), 0);
  EXPECT_LT((m - m.transpose()).norm(), 1e-15 * m.norm());
  const VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(k).eigenvalues();
  EXPECT_LT(std::abs(values[5]), 1e-10 * values.tail<1>()[0]);
  EXPECT_GT(values[6], 1e-6 * values.tail<1>()[0]);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(m).eigenvalues()[0], 0);
}

INSTANTIATE_TEST_SUITE_P(T4AndT10, Elements, testing::Values(-1.0, 0.0, 0.03), [](const auto& info) {
  return info.param < 0 ? "T4" : info.param == 0 ? "straight_T10" : "curved_T10";
});

TEST(QuadraticElement, agrees_with_a_slow_quadrature_of_another_make) {
  for (const double bulge : {0.0, 0.02}) {
    const auto x = make_t10(bulge);
    ElementMatrices element;
    ASSERT_TRUE(calc_element(x, kMaterial, job::Mass::consistent, element));
    const Interpolant place(as_rows(x));
    for (int seed = 0; seed < 3; ++seed) {
      const VectorXd u = random_vector(30, seed);
      const Interpolant field(Eigen::Map<const Eigen::Matrix<double, 10, 3, Eigen::RowMajor>>(u.data()));
      const double strain_energy = integrate(10, [&](const Vector3d& p) {
        const Matrix3d j = place.slope(p);
        return j.determinant() * energy_density(field.slope(p) * j.inverse());
      });
      const double kinetic = integrate(
          10, [&](const Vector3d& p) { return place.slope(p).determinant() * kMaterial.density_kg_m3 * field.at(p).squaredNorm(); });
      // Straight: both rules are exact. Curved: the stiffness integrand is rational, the degree 5 rule approximate.
      EXPECT_NEAR(0.5 * u.dot(stiffness(element) * u), strain_energy, (bulge == 0 ? 1e-11 : 2e-3) * strain_energy);
      double quadratic_form = 0;
      for (int d = 0; d < 3; ++d) {
        const VectorXd component = Eigen::Map<const VectorXd, 0, Eigen::InnerStride<3>>(u.data() + d, 10);
        quadratic_form += component.dot(mass(element) * component);
      }
      EXPECT_NEAR(quadratic_form, kinetic, 1e-11 * kinetic);
    }
  }
}

TEST(QuadraticElement, holds_exactly_the_energy_of_a_quadratic_field) {
  const auto x = make_t10(0);
  ElementMatrices element;
  ASSERT_TRUE(calc_element(x, kMaterial, job::Mass::consistent, element));
  const auto field = [](const Vector3d& p) -> Vector3d {
    return {p[0] * p[0] - p[1] * p[2], 2 * p[0] * p[1] + p[2], p[2] * p[2] + p[0] * p[1] - 3 * p[1] * p[1]};
  };
  const auto slope = [](const Vector3d& p) {
    Matrix3d g;
    g << 2 * p[0], -p[2], -p[1], 2 * p[1], 2 * p[0], 1, p[1], p[0] - 6 * p[1], 2 * p[2];
    return g;
  };
  // Corners and centroid: another rule of degree 2, V/20 (sum of the corners + 16 times the centroid).
  double expected = 0;
  Vector3d centroid = Vector3d::Zero();
  for (const Vec3& corner : kTet) {
    const Vector3d p(corner[0], corner[1], corner[2]);
    expected += energy_density(slope(p));
    centroid += p / 4;
  }
  expected = (expected + 16 * energy_density(slope(centroid))) * calc_volume(kTet) / 20;
  const VectorXd u = sample(x, field);
  EXPECT_NEAR(0.5 * u.dot(stiffness(element) * u), expected, 1e-12 * expected);
}

TEST(QuadraticElement, whose_mid_node_is_far_out_of_place_is_refused) {
  auto x = make_t10(0);
  x[4] = {2.0, -1.0, 1.5};
  ElementMatrices element;
  EXPECT_FALSE(calc_element(x, kMaterial, job::Mass::consistent, element));
}

TEST(LinearElement, turned_inside_out_or_flat_is_refused) {
  auto x = kTet;
  ElementMatrices element;
  std::swap(x[0], x[1]);
  EXPECT_FALSE(calc_element(x, kMaterial, job::Mass::consistent, element));
  x = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  EXPECT_FALSE(calc_element(x, kMaterial, job::Mass::consistent, element));
}

TEST(Moments, of_a_tetrahedron_obey_the_formula_of_barycentric_integrals) {
  const ElementMoments moments = calc_moments(kTet, 2700);
  const double mass = 2700 * calc_volume(kTet);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      double expected = 0;  // integral L_i L_j = V (1 + delta_ij) / 20
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) expected += mass / 20 * (i == j ? 2 : 1) * kTet[i][r] * kTet[j][c];
      EXPECT_NEAR(moments.second_kg_m2[3 * r + c], expected, 1e-11);
    }
}

TEST(Moments, of_a_curved_element_agree_with_a_slow_quadrature) {
  const auto x = make_t10(0.03);
  const Interpolant place(as_rows(x));
  const ElementMoments moments = calc_moments(x, 2700);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(moments.second_kg_m2[3 * r + c],
                  integrate(8, [&](const Vector3d& p) { return 2700 * place.at(p)[r] * place.at(p)[c] * place.slope(p).determinant(); }),
                  1e-10);
}

}  // namespace
}  // namespace carillon::fem

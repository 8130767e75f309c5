// A small blow: the frequencies and decays of every mode that it excites. Oracle: the modes of precompute/fem's matrices of the same mesh
// with lumped mass, by a dense solver.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "precompute/fem/element.hpp"
#include "precompute/simulation/transient/motion.hpp"
#include "tests/support/ranks.hpp"
#include "tests/unit/precompute/simulation/transient/bodies.hpp"

namespace carillon::transient {
namespace {

using std::numbers::pi;

struct Modes {
  Eigen::VectorXd lambda;  // [rad^2/s^2]
  Eigen::MatrixXd shapes;  // of the free nodes, mass-normalised
  std::vector<std::int32_t> free_nodes;
  Eigen::VectorXd mass;  // (3 free nodes)
};

Modes solve_modes(const testing::World& world, double young, double poisson, double density, const std::vector<std::int32_t>& fixed) {
  const Assembly& all = *world.assembly;
  material::Material material;
  material.young_modulus_pa = young;
  material.poisson_ratio = poisson;
  material.density_kg_m3 = density;
  const auto size = 3 * static_cast<Eigen::Index>(all.node_count());
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd m = Eigen::VectorXd::Zero(size);
  for (std::int32_t e = 0; e < all.element_count(); ++e) {
    const auto nodes = all.find_nodes(e);
    std::vector<Vec3> x;
    for (const std::int32_t node : nodes) x.push_back(all.nodes_m[node]);
    fem::ElementMatrices element;
    if (!fem::calc_element(x, fem::Solid(material), job::Mass::lumped, element)) ADD_FAILURE();
    const auto n = static_cast<int>(nodes.size());
    for (int a = 0; a < n; ++a)
      for (int i = 0; i < 3; ++i) {
        const auto row = static_cast<Eigen::Index>(3 * nodes[a] + i);
        m(row) += element.mass[a * n + a];
        for (int b = 0; b < n; ++b)
          for (int j = 0; j < 3; ++j) k(row, 3 * nodes[b] + j) += element.stiffness[(3 * a + i) * 3 * n + 3 * b + j];
      }
  }
  Modes modes;
  std::vector<Eigen::Index> rows;
  for (std::int32_t node = 0; node < all.node_count(); ++node) {
    if (std::find(fixed.begin(), fixed.end(), node) != fixed.end()) continue;
    modes.free_nodes.push_back(node);
    for (int i = 0; i < 3; ++i) rows.push_back(3 * node + i);
  }
  const Eigen::MatrixXd k_free = k(rows, rows);
  modes.mass = m(rows);
  const Eigen::VectorXd root = modes.mass.cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(root.asDiagonal() * k_free * root.asDiagonal());
  modes.lambda = solver.eigenvalues();
  modes.shapes = root.asDiagonal() * solver.eigenvectors();
  return modes;
}

class SmallBlow : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Orders, SmallBlow, ::testing::Values(1, 2));

TEST_P(SmallBlow, frequencies_and_decays_of_modes) {
  if (tests::get_ranks() > 1) GTEST_SKIP() << "tens of thousands of steps";
  const double young = 70e9, poisson = 0.33, density = 2700, alpha1 = 1e-7, alpha2 = 40.0;
  const std::array<int, 3> cells = GetParam() == 1 ? std::array<int, 3>{6, 2, 1} : std::array<int, 3>{4, 1, 1};
  testing::World world(
      {{"bar", testing::make_box({0.1, 0.02, 0.01}, cells, GetParam()), testing::make_law(young, poisson, density, alpha1), alpha2}});
  const auto fixed = world.list_set("x-min");
  const Modes modes = solve_modes(world, young, poisson, density, fixed);
  Motion motion(world.domain, {}, {{fixed, {}, false}},
                {{0.0, 5e-5, {1e-5, 2e-5, -3e-5}, find_shares(*world.assembly, 0, {0.047, 0.006, 0.005})}});
  motion.advance_sample();
  EXPECT_NEAR(motion.get_omega_rad_s()[0] / std::sqrt(modes.lambda.maxCoeff()), 1.0, 0.02);
  EXPECT_LE(motion.get_omega_rad_s()[0], 1.000001 * std::sqrt(modes.lambda.maxCoeff()));
  constexpr int kModes = 6;
  std::vector<std::vector<double>> q(kModes), rate(kModes);
  const int samples = 960;
  for (int n = 0; n < samples + 10; ++n) {
    motion.advance_sample();
    if (n < 10) continue;
    for (int mode = 0; mode < kModes; ++mode) {
      double sum = 0.0, speed = 0.0;
      for (std::size_t a = 0; a < modes.free_nodes.size(); ++a) {
        const std::size_t at = world.domain.find_place(modes.free_nodes[a]);
        const Quad &u = motion.get_u()[at], &v = motion.get_v()[at], &f = motion.get_f()[at];
        const double half = 0.5 * motion.get_step_s() / world.domain.get_masses_kg()[at];  // v at the time of u
        const double place[3] = {u.x, u.y, u.z}, velocity[3] = {v.x + half * f.x, v.y + half * f.y, v.z + half * f.z};
        for (int i = 0; i < 3; ++i) {
          const auto row = static_cast<Eigen::Index>(3 * a) + i;
          sum += modes.shapes(row, mode) * modes.mass(row) * place[i];
          speed += modes.shapes(row, mode) * modes.mass(row) * velocity[i];
        }
      }
      q[mode].push_back(sum);
      rate[mode].push_back(speed);
    }
  }
  const double sample_s = 1.0 / 48000.0;
  for (std::size_t mode = 0; mode < kModes; ++mode) {
    const double omega = std::sqrt(modes.lambda(static_cast<Eigen::Index>(mode))), d = 0.5 * (alpha1 * omega * omega + alpha2);
    // The phase of z = q' + (d - i omega_d) q turns by omega_d and its size falls by d: a line through both.
    const double damped = std::sqrt(omega * omega - d * d);
    double turned = 0.0, phase = 0.0;
    Eigen::MatrixXd left(samples, 2);
    Eigen::VectorXd phases(samples), sizes(samples);
    for (int n = 0; n < samples; ++n) {
      const std::size_t at = n;
      const double re = rate[mode][at] + d * q[mode][at], im = -damped * q[mode][at], now = std::atan2(im, re);
      if (n > 0) turned += std::remainder(now - phase + damped * sample_s, 2 * pi) - damped * sample_s;
      phase = now;
      left.row(n) << 1.0, n * sample_s;
      phases(n) = turned;
      sizes(n) = 0.5 * std::log(re * re + im * im);
    }
    const auto solver = left.colPivHouseholderQr();
    const double found = -solver.solve(phases)(1), decay = -solver.solve(sizes)(1), h = motion.get_step_s();
    const double cents = 1200.0 * std::log2(found / damped);
    EXPECT_LT(std::abs(cents), 1.0 + 1200.0 / std::log(2.0) * omega * omega * h * h / 24.0) << mode << ": " << damped / (2 * pi) << " Hz";
    EXPECT_NEAR(decay / d, 1.0, 0.02) << mode << ": " << d << " 1/s";
  }
  EXPECT_LT(std::abs(motion.calc_book().relative_error), 1e-6);
}

}  // namespace
}  // namespace carillon::transient

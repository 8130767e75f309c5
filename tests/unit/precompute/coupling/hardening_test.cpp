// Hardening of single modes against closed forms of thin beams and plates: Woinowsky-Krieger 1950 for beams, von Karman's plate with the
// membrane part by an independent Ritz method.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "precompute/coupling/static_answer.hpp"
#include "precompute/coupling/strains.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/unit/precompute/coupling/bodies.hpp"

namespace carillon::coupling {
namespace {

using tests::make_box;
using tests::make_solid;
using tests::ModalBody;
using tests::solve_body;

const material::Material kBar = make_solid(70e9, 0.0, 2700);
const material::Material kSheet = make_solid(200e9, 0.3, 7800);

Condensed condense(const ModalBody& body, int modes) { return condense_modes(body.comm, body.solved(), {.modes = modes, .below_hz = 1e6}); }

/// Both ends clamped; amplitude in thicknesses.
double calc_clamped_beam(std::array<int, 3> cells) {
  const double length = 0.2;
  const auto held = [&](const Vec3& x) { return x[0] < 1e-9 || x[0] > length - 1e-9; };
  const ModalBody body = solve_body(PETSC_COMM_WORLD, make_box(cells, {length, 0.008, 0.004}, 2), held, kBar, 4);
  return tests::calc_gamma(body, condense(body, 1).energy, 0, 0.004);
}

TEST(Hardening, of_a_clamped_beam_is_that_of_the_thin_beam) {
  EXPECT_NEAR(calc_clamped_beam({12, 1, 1}), 0.71757, 2e-3);  // a prototype with central differences of the element forces
  const double gamma = calc_clamped_beam({24, 2, 2});
  EXPECT_NEAR(gamma, 0.72331, 2e-3);
  EXPECT_NEAR(gamma / 0.719293030305, 1, 0.02);
}

TEST(Hardening, without_condensation_would_be_three_times_too_great) {
  // With all other displacements held, V = 1/2 <E2, C E2>: a prototype gives 2.096.
  const double length = 0.2;
  const auto held = [&](const Vec3& x) { return x[0] < 1e-9 || x[0] > length - 1e-9; };
  const ModalBody body = solve_body(PETSC_COMM_WORLD, make_box({12, 1, 1}, {length, 0.008, 0.004}, 2), held, kBar, 2);
  const Strains strains(body.pieces.local, body.materials);
  const la::LocalColumns shapes(body.modes.shapes);
  comm::HaloExchange halo = make_halo(body.comm, body.pieces.local);
  const Nodal nodal = spread(body.comm, halo, body.pieces.local, shapes.view().part(0, 1));
  ElementPoints points;
  RowMatrix values, gradients, z;
  double whole = 0;
  for (std::int32_t e = 0; e < strains.element_count(); ++e) {
    strains.calc_points(e, points);
    strains.gather(e, nodal.data(), 1, values);
    Strains::calc_gradients(points, values, gradients);
    strains.calc_square_strains(e, points, gradients, z);
    whole += z.squaredNorm();
  }
  EXPECT_NEAR(calc_hardening(body.comm.sum(whole), body.modes.lambda[0], body.peak(0), 0.004), 2.096, 0.02);
}

TEST(Hardening, of_a_hinged_beam_is_three) {
  // Held along the middle line of the end faces, which rotate but keep their distance.
  const double length = 0.4, thickness = 0.001;
  const auto held = [&](const Vec3& x) { return (x[0] < 1e-9 || x[0] > length - 1e-9) && std::abs(x[2] - thickness / 2) < 1e-9; };
  const ModalBody body = solve_body(PETSC_COMM_WORLD, make_box({40, 1, 1}, {length, 0.004, thickness}, 2), held, kBar, 3);
  EXPECT_NEAR(body.freq_hz(0), M_PI / 2 * std::sqrt(70e9 / 2700 / 12) * thickness / (length * length), 0.1);
  EXPECT_NEAR(tests::calc_gamma(body, condense(body, 1).energy, 0, thickness) / 3, 1, 0.02);
}

TEST(Hardening, of_a_free_beam_is_small) {
  const ModalBody body = solve_body(PETSC_COMM_WORLD, make_box({16, 1, 1}, {0.2, 0.008, 0.004}, 2), {}, kBar, 4);
  const double gamma = tests::calc_gamma(body, condense(body, 1).energy, 0, 0.004);
  EXPECT_GT(gamma, 0);
  EXPECT_LT(gamma, 0.01) << "its ends approach each other, and nothing is stretched";
}

/// gamma of the first mode of a plate with hinged, in-plane fixed edges: w = W sin sin, u and v by 12 x 12 products of sines.
double calc_held_plate(double nu) {
  constexpr int kTerms = 12, kPoints = 48;
  const auto unknowns = static_cast<Eigen::Index>(2 * kTerms * kTerms);
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(unknowns, unknowns);
  Eigen::VectorXd f = Eigen::VectorXd::Zero(unknowns);
  double whole = 0;
  const Eigen::Matrix3d c = (Eigen::Matrix3d() << 1, nu, 0, nu, 1, 0, 0, 0, (1 - nu) / 2).finished() / (1 - nu * nu);
  for (int a = 0; a < kPoints; ++a)
    for (int b = 0; b < kPoints; ++b) {  // midpoints: exact for these trigonometric polynomials
      const double x = (a + 0.5) / kPoints, y = (b + 0.5) / kPoints, area = 1.0 / (kPoints * kPoints);
      const double wx = M_PI * std::cos(M_PI * x) * std::sin(M_PI * y), wy = M_PI * std::sin(M_PI * x) * std::cos(M_PI * y);
      const Eigen::Vector3d e2(wx * wx / 2, wy * wy / 2, wx * wy);
      Eigen::MatrixXd strain = Eigen::MatrixXd::Zero(3, unknowns);
      for (int m = 0; m < kTerms; ++m)
        for (int n = 0; n < kTerms; ++n) {
          const double mx = M_PI * (m + 1), ny = M_PI * (n + 1);
          const double dx = mx * std::cos(mx * x) * std::sin(ny * y), dy = ny * std::sin(mx * x) * std::cos(ny * y);
          const Eigen::Index at = m * kTerms + n;
          strain(0, at) = strain(2, at + kTerms * kTerms) = dx;
          strain(2, at) = strain(1, at + kTerms * kTerms) = dy;
        }
      k += area * strain.transpose() * c * strain;
      f += area * strain.transpose() * (c * e2);
      whole += area * e2.dot(c * e2);
    }
  const double membrane = whole - f.dot(k.ldlt().solve(f));  // 2 V / (E h W^4 / a^2)
  // V4 / V2 = gamma / 2 (W / h)^2, V2 = pi^4 D (W / a)^2 / 2, D = E h^3 / (12 (1 - nu^2))
  return 24 * (1 - nu * nu) * membrane / std::pow(M_PI, 4);
}

TEST(Hardening, of_a_hinged_square_plate_is_von_Karmans) {
  const double side = 0.3, thickness = 0.003;
  const auto on_edge = [&](double x) { return std::abs(x) > side / 2 - 1e-9; };
  const auto held = [&](const Vec3& x) { return (on_edge(x[0]) || on_edge(x[1])) && std::abs(x[2]) < 1e-9; };
  const ModalBody body = solve_body(PETSC_COMM_WORLD, shapes::make_box({side, side, thickness}, {16, 16, 1}, 2), held, kSheet, 4);
  EXPECT_NEAR(body.freq_hz(0) / (3 * 53.318), 1, 0.01);
  const Condensed result = condense(body, 1);
  EXPECT_NEAR(tests::calc_gamma(body, result.energy, 0, thickness) / calc_held_plate(0.3), 1, 0.02);
  EXPECT_EQ(result.energy.linear.size(), 0u) << "it is flat";
}

TEST(Hardening, of_a_clamped_disc_is_von_Karmans) {
  shapes::ShapeOptions options{.shape = "disc", .dimensions = {{"radius", 0.2}, {"thickness", 0.002}}};
  options.order = 2;
  options.target_nodes = 9000;
  const mesh::TetMesh disc = shapes::make_shape(options);
  const auto held = [](const Vec3& x) { return std::hypot(x[0], x[1]) > 0.2 - 1e-6; };
  const ModalBody body = solve_body(PETSC_COMM_WORLD, disc, held, kSheet, 3);
  EXPECT_NEAR(tests::calc_gamma(body, condense(body, 1).energy, 0, 0.002) / 0.5008, 1, 0.02);
}

}  // namespace
}  // namespace carillon::coupling

// Tables of docs/elements.md: convergence of T4 and T10 on a ball (Lamb) and on a chime (3-D Fourier-Ritz), straight and curved, and near
// nu = 1/2. Prints one line per mesh and checks the orders and the chime's errors against the page.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/lamb.hpp"

namespace carillon::fem {
namespace {

std::vector<double> calc_omega(const mesh::TetMesh& mesh, const material::Material& material, Form form, double low_hz, double high_hz) {
  mesh::DistributedMesh pieces = mesh::distribute(PETSC_COMM_WORLD, mesh, {});
  const System system = assemble(PETSC_COMM_WORLD, pieces.local, material, job::Mass::consistent, form);
  eigen::NodeLayout layout;
  layout.nodes_m.assign(pieces.local.nodes_m.begin(), pieces.local.nodes_m.begin() + pieces.local.free_nodes);
  layout.component.assign(pieces.local.component.begin(), pieces.local.component.begin() + pieces.local.free_nodes);
  layout.component_count = pieces.components;
  eigen::Options options;
  options.low_hz = low_hz;
  options.high_hz = high_hz;
  std::vector<double> omega;
  for (const double lambda : eigen::solve_modes({system.stiffness, system.mass, std::move(layout)}, options).lambda)
    omega.push_back(std::sqrt(lambda));
  return omega;
}

mesh::TetMesh make(const std::string& shape, const std::map<std::string, double>& dimensions, int order, double edge_m, bool straight) {
  shapes::ShapeOptions options;
  options.shape = shape;
  options.dimensions = dimensions;
  options.order = order;
  options.edge_m = edge_m;
  mesh::TetMesh mesh = shapes::make_shape(options);
  return straight ? mesh::to_quadratic(mesh::to_linear(mesh)) : mesh;
}

/// Prints the errors of the ball on three meshes; returns the order of S2 between the last two, by the cube root of the number of elements.
double study_ball(const char* element, double nu, int order, Form form, bool straight) {
  std::vector<double> error, elements;
  for (const double edge : {0.8, 0.45, 0.21}) {
    const auto mesh = make("sphere", {{"radius", 1.0}}, order, edge, straight);
    material::Material material;
    material.young_modulus_pa = 2 * (1 + nu);
    material.poisson_ratio = nu;
    material.density_kg_m3 = 1;
    const auto omega = calc_omega(mesh, material, form, 0.1, 3.6 / (2 * std::numbers::pi));
    if (omega.size() < 10) {
      ADD_FAILURE() << element << ", nu " << nu << ": " << omega.size() << " modes";
      return 0.0;
    }
    double t2 = 0, s2 = 0;
    for (int i = 0; i < 5; ++i) {
      t2 = std::max(t2, std::abs(omega[i] / tests::kT2 - 1));
      s2 = std::max(s2, std::abs(omega[5 + i] / tests::find_s2(nu) - 1));
    }
    fmt::print("ball   {:<24} nu {:<7} {:6} nodes {:6} elements  T2 {:8.4f} %  S2 {:8.4f} %\n", element, nu, mesh.nodes_m.size(),
               mesh.tet_count(), 100 * t2, 100 * s2);
    error.push_back(s2);
    elements.push_back(static_cast<double>(mesh.tet_count()));
  }
  return 3 * std::log(error[1] / error[2]) / std::log(elements[2] / elements[1]);
}

TEST(Convergence, of_the_ball) {
  EXPECT_GT(study_ball("T10 curved", 0.3, 2, Form::automatic, false), 3.5);
  const double straight = study_ball("T10 straight", 0.3, 2, Form::automatic, true);
  EXPECT_GT(straight, 1.8);
  EXPECT_LT(straight, 2.2);
  for (const double nu : {0.45, 0.49, 0.499, 0.4999}) EXPECT_GT(study_ball("T10 curved", nu, 2, Form::automatic, false), 3.5) << nu;
  for (const double nu : {0.49, 0.4999}) study_ball("T10 displacement form", nu, 2, Form::displacement, false);
  EXPECT_GT(study_ball("T4", 0.3, 1, Form::automatic, false), 1.7);
  for (const double nu : {0.4, 0.45, 0.4999}) study_ball("T4", nu, 1, Form::automatic, false);
}

/// An orthotropic solid, nearly incompressible: every row of its compliance sums to `play` / E.
material::Material make_orthotropic_rubber(double play) {
  constexpr double e1 = 3.0, e2 = 2.0, e3 = 1.5;
  material::Material material;
  material.density_kg_m3 = 1;
  material.orthotropic = material::Orthotropic{};
  material.orthotropic->young_modulus_pa = {e1, e2, e3};
  material.orthotropic->shear_modulus_pa = {0.9, 0.5, 0.7};
  material.orthotropic->poisson_ratio = {(1 - play) * (1 + e1 / e2 - e1 / e3) / 2, (1 - play) * (1 + e2 / e3 - e2 / e1) / 2,
                                         (1 - play) * (1 + e1 / e3 - e1 / e2) / 2};
  return material;
}

/// Errors of the ball's first ten modes against the finest mesh of the same formulation, fourth order for an isotropic solid; {160
/// elements, 540 elements}.
std::array<double, 2> study_orthotropic(const char* element, const std::vector<double>& exact, double play, Form form) {
  std::array<double, 2> errors{};
  for (int k = 0; k < 2; ++k) {
    const auto mesh = make("sphere", {{"radius", 1.0}}, 2, k == 0 ? 0.8 : 0.45, false);
    const auto omega = calc_omega(mesh, make_orthotropic_rubber(play), form, 0.05, 1.0);
    for (std::size_t i = 0; i < 10; ++i) errors[k] = std::max(errors[k], std::abs(omega.at(i) / exact.at(i) - 1));
    fmt::print("ball   {:<24} orthotropic, play {:<7} {:6} elements  worst of ten modes {:8.4f} %\n", element, play, mesh.tet_count(),
               100 * errors[k]);
  }
  return errors;
}

TEST(Convergence, of_an_orthotropic_ball_that_is_nearly_incompressible) {
  const auto fine = make("sphere", {{"radius", 1.0}}, 2, 0.21, false);
  for (const double play : {2e-2, 2e-4}) {
    const auto exact = calc_omega(fine, make_orthotropic_rubber(play), Form::automatic, 0.05, 1.0);
    const auto mean = study_orthotropic("T10 curved", exact, play, Form::automatic);
    const auto plain = study_orthotropic("T10 displacement form", exact, play, Form::displacement);
    EXPECT_GT(3 * std::log(mean[0] / mean[1]) / std::log(540.0 / 160.0), 3.8);
    if (play < 1e-3) {
      EXPECT_GT(plain[1], 10 * mean[1]);
    }
  }
}

TEST(Convergence, of_the_chime) {
  // D3 of OSG02 Table 2: 0.505 m, outer radius 12.5 mm, wall 1 mm, aluminium of Table 1; exact in 3-D (Fourier-Ritz): 587.88302 Hz.
  material::Material aluminium;
  aluminium.young_modulus_pa = 68351788079.47;
  aluminium.poisson_ratio = 0.32980132450331;
  aluminium.density_kg_m3 = 2700;
  for (const bool straight : {false, true})
    for (const auto& [edge, sides] : {std::pair(0.012, 12), std::pair(0.008, 12), std::pair(0.005, 16)}) {
      const auto mesh = make("tube", {{"length", 0.505}, {"outer-radius", 0.0125}, {"wall", 0.001}}, 2, edge, straight);
      const auto omega = calc_omega(mesh, aluminium, Form::automatic, 20, 800);
      ASSERT_GE(omega.size(), 2u);
      const double error = omega[0] / (2 * std::numbers::pi) / 587.88302 - 1;
      // A ring of n straight sides is flattened by sin^2(pi / n) / 3.
      const double polygon = straight ? -std::pow(std::sin(std::numbers::pi / sides), 2) / 3 : 0.0;
      EXPECT_NEAR(error, polygon, 5e-4) << edge;
      fmt::print("chime  {:<24}            {:6} nodes {:6} elements  first bending {:8.4f} %\n", straight ? "T10 straight" : "T10 curved",
                 mesh.nodes_m.size(), mesh.tet_count(), 100 * error);
    }
}

}  // namespace
}  // namespace carillon::fem

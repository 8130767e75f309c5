// Error bars: coverage, sharpness, and independence of the number of ranks.
#include <gtest/gtest.h>
#include <petscmat.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/fem/error_bars/algebraic.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/unit/precompute/fem/error_bars/bodies.hpp"

namespace carillon::tests {
namespace {

class KnownBody : public testing::TestWithParam<Case> {};

TEST_P(KnownBody, lies_within_its_bars_which_are_less_than_ten_times_too_wide_at_the_median) {
  const auto& [name, fineness, kind] = GetParam();
  const Outcome outcome = solve(PETSC_COMM_WORLD, get_body(name), fineness, kind);
  ASSERT_EQ(outcome.true_hz.size(), read_truth(name).size());
  EXPECT_GE(outcome.coverage(), 0.95);
  EXPECT_LT(outcome.median_width(), 10.0);
  for (const auto& parts : outcome.bars.level.parts)
    EXPECT_NEAR(parts.energy, 1.0, 1e-2);  // as summed by K; curved elements use a shorter rule
}

INSTANTIATE_TEST_SUITE_P(ErrorBars, KnownBody,
                         testing::Values(Case{"cube", 6, MeshKind::T4}, Case{"cube", 6, MeshKind::T4Lumped},
                                         Case{"cube-nu045", 3, MeshKind::T10}, Case{"bar", 4, MeshKind::T4}, Case{"plate", 2, MeshKind::T4},
                                         Case{"slab", 3, MeshKind::T4}, Case{"cantilever", 2, MeshKind::T10},
                                         Case{"ring", 1200, MeshKind::T4}, Case{"ring", 300, MeshKind::T10},
                                         Case{"ring", 1200, MeshKind::T10Curved}, Case{"ball", 1200, MeshKind::T4},
                                         Case{"pipe", 2500, MeshKind::T4}, Case{"spruce-bar", 2, MeshKind::T10},
                                         Case{"spruce-block", 3, MeshKind::T10}, Case{"rod-two", 2, MeshKind::T10},
                                         Case{"bar-two", 2, MeshKind::T10}, Case{"rubber-ball", 300, MeshKind::T10Curved}));

class Strip : public testing::TestWithParam<Case> {};

TEST_P(Strip, in_torsion_lies_within_its_bars_with_elements_that_do_not_see_the_layer_along_its_edges) {
  const auto& [name, fineness, kind] = GetParam();
  const Outcome outcome = solve(PETSC_COMM_WORLD, get_body(name), fineness, kind);
  for (std::size_t m = 0; m < outcome.true_hz.size(); ++m)
    EXPECT_TRUE(outcome.contains(m)) << m << ": " << outcome.error_cents(m) << " cents, bar " << outcome.bar_cents(m);
  EXPECT_LT(outcome.median_width(), 4.0);
}

// One, two and three layers; elements of 1.7 to 10 thicknesses; nu 0, 0.3 and 0.45, orthotropic, fixed at one end.
INSTANTIATE_TEST_SUITE_P(ErrorBars, Strip,
                         testing::Values(Case{"strip-thin", 41, MeshKind::T10}, Case{"strip-thin", 32, MeshKind::T10},
                                         Case{"strip-thick", 21, MeshKind::T10}, Case{"strip-thick", 31, MeshKind::T10},
                                         Case{"strip-thick", 23, MeshKind::T10}, Case{"strip-nu0", 42, MeshKind::T10},
                                         Case{"strip-nu045", 42, MeshKind::T10}, Case{"strip-spruce", 41, MeshKind::T10},
                                         Case{"strip-fixed", 21, MeshKind::T10}, Case{"plate-thin", 61, MeshKind::T10}));

TEST(ErrorBars, of_the_breathing_triplet_of_a_thick_hollow_sphere_hold_by_themselves) {
  // Without the contribution of unlisted kinds of modes; the elements at the hole leave tractions on it.
  for (const auto& [name, hz] : {std::pair{"shell-3", 18303.9301}, std::pair{"shell-5", 19295.2866}}) {
    const Outcome outcome = solve(PETSC_COMM_WORLD, get_body(name), 900, MeshKind::T10Curved);
    int modes = 0;
    for (std::size_t m = 0; m < outcome.true_hz.size(); ++m) {
      if (std::abs(outcome.true_hz[m] / hz - 1) > 1e-6) continue;
      ++modes;
      const double own = error_bars::calc_cents(outcome.bars.level.parts[m], outcome.bars.level.kind);
      EXPECT_LT(outcome.error_cents(m), own) << name << " " << m;
      EXPECT_GT(3 * outcome.error_cents(m), own) << name << " " << m;
    }
    EXPECT_EQ(modes, 3);
    EXPECT_EQ(outcome.coverage(), 1.0);
  }
}

TEST(ErrorBars, of_a_slender_bar_of_T10_are_less_than_four_times_too_wide) {
  // All its patches are one-sided: a recovery that is not exact for linear strains there gave bars eleven times too wide.
  const Outcome outcome = solve(PETSC_COMM_WORLD, get_body("slender-bar"), 1000, MeshKind::T10);
  EXPECT_EQ(outcome.coverage(), 1.0);
  EXPECT_LT(outcome.median_width(), 4.0);
}

TEST(ErrorBars, of_stretching_a_rod_of_two_materials_hold_the_roots_of_its_equation) {
  // Z1 tan(w l1 / c1) + Z2 tan(w l2 / c2) = 0, nu = 0: exact for the three-dimensional body too.
  const Outcome outcome = solve(PETSC_COMM_WORLD, get_body("rod-two"), 2, MeshKind::T10);
  const double z1 = std::sqrt(200e9 * 7850), z2 = std::sqrt(70e9 * 2700);
  const double t1 = 0.15 * std::sqrt(7850 / 200e9), t2 = 0.15 * std::sqrt(2700 / 70e9);
  const auto equation = [&](double hz) {
    const double w = 2 * std::numbers::pi * hz;
    return z1 * std::sin(w * t1) * std::cos(w * t2) + z2 * std::cos(w * t1) * std::sin(w * t2);
  };
  int roots = 0;
  for (double hz = 1000; hz < 20e3; hz += 10) {
    if (equation(hz) * equation(hz + 10) > 0) continue;
    double low = hz, high = hz + 10;
    for (int i = 0; i < 60; ++i) (equation((low + high) / 2) * equation(low) > 0 ? low : high) = (low + high) / 2;
    ++roots;
    bool found = false;
    for (std::size_t m = 0; m < outcome.freq_hz.size(); ++m)
      found = found || (std::abs(1200 * std::log2(outcome.freq_hz[m] / low)) <= outcome.bar_cents(m) && outcome.bar_cents(m) < 0.05);
    EXPECT_TRUE(found) << low;
  }
  EXPECT_EQ(roots, 2);
}

TEST(ErrorBars, of_a_bar_of_one_coarse_layer_of_T4_which_is_a_hundred_per_cent_sharp_still_hold) {
  const Outcome outcome = solve(PETSC_COMM_WORLD, get_body("bar"), -1, MeshKind::T4);
  double largest = 0;
  for (std::size_t m = 0; m < outcome.true_hz.size(); ++m) {
    largest = std::max(largest, outcome.error_cents(m));
    EXPECT_TRUE(outcome.contains(m)) << m;
  }
  EXPECT_GT(largest, 900);
  EXPECT_LT(outcome.median_width(), 10.0);
}

/// A small body with its matrices and optionally its modes.
struct Solved {
  mesh::DistributedMesh pieces;
  fem::System system;
  eigen::Modes modes;
  error_bars::Solid solid;
};

Solved solve_by_hand(const std::string& name, int fineness, MeshKind kind, int max_modes) {
  const Body& body = get_body(name);
  std::vector<std::int32_t> fixed;
  const mesh::TetMesh mesh = make_mesh(body, fineness, kind, fixed);
  const material::Material& material = body.materials.front();
  Solved solved;
  solved.pieces = mesh::distribute(PETSC_COMM_WORLD, mesh, fixed);
  const auto& local = solved.pieces.local;
  solved.system = fem::assemble(PETSC_COMM_WORLD, local, material, job::Mass::consistent);
  solved.solid = {material.calc_elasticity_pa(), material.density_kg_m3};
  if (max_modes == 0) return solved;
  eigen::NodeLayout layout;
  layout.nodes_m.assign(local.nodes_m.begin(), local.nodes_m.begin() + local.free_nodes);
  layout.component.assign(local.component.begin(), local.component.begin() + local.free_nodes);
  layout.component_count = solved.pieces.components;
  layout.fixed = solved.pieces.fixed_m;
  eigen::Options options;
  options.high_hz = 1e7;
  options.max_modes = max_modes;
  solved.modes = eigen::solve_modes({solved.system.stiffness, solved.system.mass, layout}, options);
  return solved;
}

TEST(AlgebraicBar, contains_the_true_eigenvalue_of_modes_that_were_spoilt) {
  Solved solved = solve_by_hand("prism", 2, MeshKind::T10, 8);
  const std::vector<double> lambda = solved.modes.lambda;
  std::vector<double> spoilt, residual;
  std::mt19937 random(3);
  std::normal_distribution<double> noise;
  petsc::VecHandle x, kx, mx;
  petsc::check(MatCreateVecs(solved.system.mass, x.out(), kx.out()));
  petsc::check(VecDuplicate(x, mx.out()));
  for (std::size_t m = 0; m < lambda.size(); ++m) {
    PetscInt rows = 0;
    petsc::check(VecGetLocalSize(x, &rows));
    Vec column = nullptr;
    petsc::check(MatDenseGetColumnVec(solved.modes.shapes, static_cast<PetscInt>(m), &column));
    PetscScalar* values = nullptr;
    petsc::check(VecGetArray(column, &values));
    for (PetscInt i = 0; i < rows; ++i) values[i] *= 1 + 3e-6 * noise(random);
    petsc::check(VecRestoreArray(column, &values));
    petsc::check(MatMult(solved.system.mass, column, mx));
    PetscScalar mass = 0, energy = 0;
    petsc::check(VecDot(column, mx, &mass));
    petsc::check(VecScale(column, 1 / std::sqrt(mass)));
    petsc::check(VecScale(mx, 1 / std::sqrt(mass)));
    petsc::check(MatMult(solved.system.stiffness, column, kx));
    petsc::check(VecDot(column, kx, &energy));
    petsc::check(VecAXPY(kx, -energy, mx));
    PetscReal above = 0, below = 0;
    petsc::check(VecNorm(kx, NORM_2, &above));
    petsc::check(VecNorm(mx, NORM_2, &below));
    spoilt.push_back(energy);
    residual.push_back(above / (energy * below));
    petsc::check(MatDenseRestoreColumnVec(solved.modes.shapes, static_cast<PetscInt>(m), &column));
  }
  const error_bars::ErrorBars bars = error_bars::calc_error_bars(
      PETSC_COMM_WORLD, solved.pieces.local, solved.system.stiffness, solved.system.mass, std::span(&solved.solid, 1), {},
      job::Mass::consistent, {spoilt, residual, solved.modes.shapes, 20, std::sqrt(spoilt.back()) / (2 * std::numbers::pi)});
  for (std::size_t m = 0; m < lambda.size(); ++m) {
    const double error = 600 * std::abs(std::log2(spoilt[m] / lambda[m]));
    EXPECT_GT(error, 1e-7) << "the test must spoil something";
    EXPECT_LE(error, bars.algebraic_cents[m]) << m;
    EXPECT_LT(bars.algebraic_cents[m], 200) << m;
  }
}

TEST(AlgebraicBar, of_converged_modes_is_next_to_nothing) {
  const Outcome outcome = solve(PETSC_COMM_WORLD, get_body("box"), -3, MeshKind::T4);
  for (const double cents : outcome.bars.algebraic_cents) {
    EXPECT_GT(cents, 0);  // rounding leaves something open always
    EXPECT_LT(cents, 1e-2);
  }
}

class MassBounds : public testing::TestWithParam<Case> {};

TEST_P(MassBounds, enclose_the_mass_between_multiples_of_its_diagonal) {
  const auto& [name, fineness, kind] = GetParam();
  Solved solved = solve_by_hand(name, fineness, kind, 0);
  const error_bars::MassBounds bounds = error_bars::find_mass_bounds(PETSC_COMM_WORLD, solved.pieces.local, job::Mass::consistent);
  EXPECT_GT(bounds.min, 0.02);
  EXPECT_LT(bounds.max, 10);
  // D^-1/2 M D^-1/2 by power iteration, from above and, shifted, from below.
  petsc::VecHandle scale, x, y;
  petsc::check(MatCreateVecs(solved.system.mass, scale.out(), x.out()));
  petsc::check(VecDuplicate(x, y.out()));
  petsc::check(MatGetDiagonal(solved.system.mass, scale));
  petsc::check(VecSqrtAbs(scale));
  petsc::check(VecReciprocal(scale));
  petsc::check(MatDiagonalScale(solved.system.mass, scale, scale));
  double extreme[2] = {0, 0};
  for (int end = 0; end < 2; ++end) {
    const double shift = end == 0 ? 0 : extreme[0];
    petsc::check(VecSetRandom(x, nullptr));
    for (int step = 0; step < 300; ++step) {
      PetscReal norm = 0;
      PetscScalar quotient = 0;
      petsc::check(VecNormalize(x, &norm));
      petsc::check(MatMult(solved.system.mass, x, y));
      petsc::check(VecDot(x, y, &quotient));
      extreme[end] = quotient;
      petsc::check(VecAXPY(y, -shift, x));
      petsc::check(VecCopy(y, x));
    }
  }
  EXPECT_LE(extreme[0], bounds.max);
  EXPECT_GE(extreme[1], bounds.min);
  EXPECT_LT(bounds.max, 4 * extreme[0]);
  EXPECT_GT(bounds.min, extreme[1] / 8);
}

INSTANTIATE_TEST_SUITE_P(ErrorBars, MassBounds,
                         testing::Values(Case{"box", -3, MeshKind::T4}, Case{"box", -3, MeshKind::T10},
                                         Case{"ball", 300, MeshKind::T10Curved}));

TEST(GeometryPart, foretells_what_curving_the_sides_of_T10_changes) {
  // Reference: the same lattice with mid nodes on the true cylinders, solved.
  const Outcome straight = solve(PETSC_COMM_WORLD, get_body("cylinder-2"), 3, MeshKind::T10),
                curved = solve(PETSC_COMM_WORLD, get_body("cylinder-2"), 3, MeshKind::T10Curved);
  // Modes change order, so both lists are sorted.
  double largest = 0;
  std::vector<double> foretold;
  for (std::size_t m = 0; m < straight.freq_hz.size(); ++m) {
    largest = std::max(largest, std::abs(curved.freq_hz[m] / straight.freq_hz[m] - 1));
    foretold.push_back(straight.freq_hz[m] * std::sqrt(1 + straight.bars.level.parts[m].geometry));
  }
  std::sort(foretold.begin(), foretold.end());
  EXPECT_GT(largest, 0.003);
  for (std::size_t m = 0; m + 4 < foretold.size(); ++m) EXPECT_NEAR(foretold[m] / curved.freq_hz[m], 1, 0.25 * largest) << m;
}

TEST(GeometryPart, is_nothing_where_faces_are_flat) {
  const Outcome outcome = solve(PETSC_COMM_WORLD, get_body("box"), -3, MeshKind::T4);
  for (const auto& parts : outcome.bars.level.parts) EXPECT_EQ(parts.geometry_noise, 0);
}

TEST(GeometryPart, of_a_round_rod_with_six_sides_is_a_doubt_next_to_the_bars_of_rough_modes) {
  const Outcome outcome = solve(PETSC_COMM_WORLD, get_body("cylinder-10"), 1, MeshKind::T10);
  const error_bars::Corrections& corrected = outcome.bars.corrected;
  ASSERT_EQ(corrected.facet_cents.size(), outcome.freq_hz.size());
  int outside = 0;
  for (std::size_t m = 0; m < outcome.true_hz.size(); ++m) {
    const std::size_t c = outcome.by_correction[m];
    const double error = std::abs(outcome.corrected_error_cents(m));
    EXPECT_LE(error, outcome.corrected_bar_cents(m) + corrected.facet_cents[c]) << m;
    if (error <= outcome.corrected_bar_cents(m)) continue;
    outside += error > 50 ? 1 : 0;
    EXPECT_EQ(corrected.correction[c], bank::Correction::kRough) << m;
  }
  EXPECT_GE(outside, 6) << "the mesh no longer has the error that this test is about";
}

TEST(GeometryPart, of_a_rod_whose_six_planes_are_two_elements_wide_is_no_doubt) {
  std::vector<std::int32_t> fixed;
  const Body& body = get_body("cylinder-10");
  mesh::TetMesh rod = make_mesh(body, 2, MeshKind::T4, fixed);
  for (Vec3& x : rod.nodes_m)  // twelve sides: every other corner goes to the middle of a plane
    if (std::abs(std::remainder(std::atan2(x[1], x[0]) - std::numbers::pi / 6, std::numbers::pi / 3)) < 1e-6)
      for (int k = 0; k < 2; ++k) x[k] *= std::cos(std::numbers::pi / 6);
  const Outcome outcome = solve(PETSC_COMM_WORLD, mesh::to_quadratic(rod), fixed, body.materials, false, 20, 1e6, 12);
  EXPECT_TRUE(outcome.bars.facet_cents.empty());
  for (const auto& parts : outcome.bars.level.parts) EXPECT_EQ(parts.geometry_noise, 0);
}

TEST(Materials, are_smoothed_each_by_itself) {
  // A bar of two materials, one ten times as stiff: strains jump at the interface; T10 represent that, with equal energy.
  Solved solved = solve_by_hand("bar", -1, MeshKind::T10, 0);
  const auto& local = solved.pieces.local;
  std::vector<std::int32_t> material_of_tet;
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    double x = 0;
    for (int i = 0; i < 4; ++i) x += local.nodes_m[local.tets[10 * e + i]][0] / 4;
    material_of_tet.push_back(x < 0 ? 0 : 1);
  }
  // A stretch that is linear in each half and exact: not a mode, but the estimate must see no error in it.
  std::vector<error_bars::Solid> solids;
  for (const double young_modulus_pa : {1e9, 10e9}) {
    material::Material material;
    material.young_modulus_pa = young_modulus_pa;
    material.poisson_ratio = 0;
    solids.push_back({material.calc_elasticity_pa(), 1000});
  }
  petsc::MatHandle shapes;
  petsc::check(MatCreateDense(PETSC_COMM_WORLD, 3 * local.free_nodes, PETSC_DECIDE, PETSC_DETERMINE, 1, nullptr, shapes.out()));
  PetscScalar* values = nullptr;
  petsc::check(MatDenseGetArray(shapes, &values));
  for (std::int32_t i = 0; i < local.free_nodes; ++i) {
    const double x = local.nodes_m[i][0];
    values[3 * i] = x < 0 ? 10 * x : x;
    values[3 * i + 1] = values[3 * i + 2] = 0;
  }
  petsc::check(MatDenseRestoreArray(shapes, &values));
  petsc::check(MatAssemblyBegin(shapes, MAT_FINAL_ASSEMBLY));
  petsc::check(MatAssemblyEnd(shapes, MAT_FINAL_ASSEMBLY));
  const std::vector<double> lambda{1e6}, residual{1e-8};
  // A lumped mass is used, since a consistent one would add the tractions at the ends.
  const auto bars = error_bars::calc_error_bars(PETSC_COMM_WORLD, local, solved.system.stiffness, solved.system.mass, solids,
                                                material_of_tet, job::Mass::lumped, {lambda, residual, shapes, 20, 1e6});
  ASSERT_EQ(bars.level.parts.size(), 1U);
  EXPECT_GT(bars.level.parts[0].energy, 0);
  EXPECT_LT(bars.level.parts[0].interpolation, 1e-6 * bars.level.parts[0].energy);
}

/// Parts of the estimate for a given displacement of the coarse T10 bar: not a mode, lambda = 1e6.
template <typename Field>
error_bars::ErrorParts estimate_field(const Solved& solved, job::Mass mass_kind, const Field& field) {
  const auto& local = solved.pieces.local;
  petsc::MatHandle shapes;
  petsc::check(MatCreateDense(PETSC_COMM_WORLD, 3 * local.free_nodes, PETSC_DECIDE, PETSC_DETERMINE, 1, nullptr, shapes.out()));
  PetscScalar* values = nullptr;
  petsc::check(MatDenseGetArray(shapes, &values));
  for (std::int32_t i = 0; i < local.free_nodes; ++i) {
    const Vec3 u = field(local.nodes_m[i]);
    std::copy(u.begin(), u.end(), values + 3 * i);
  }
  petsc::check(MatDenseRestoreArray(shapes, &values));
  petsc::check(MatAssemblyBegin(shapes, MAT_FINAL_ASSEMBLY));
  petsc::check(MatAssemblyEnd(shapes, MAT_FINAL_ASSEMBLY));
  const std::vector<double> lambda{1e6}, residual{1e-8};
  return error_bars::calc_error_bars(PETSC_COMM_WORLD, local, solved.system.stiffness, solved.system.mass, std::span(&solved.solid, 1), {},
                                     mass_kind, {lambda, residual, shapes, 20, 1e6})
      .level.parts.at(0);
}

TEST(Recovery, keeps_linear_strains_exactly_wherever_elements_are_few) {
  // Pure bending, u quadratic in position, is exact for T10: no error must be seen, not even at the corners of a single layer. A lumped
  // mass is used, since a consistent one would add the tractions at the ends.
  const Solved solved = solve_by_hand("bar", -1, MeshKind::T10, 0);
  const auto parts = estimate_field(solved, job::Mass::lumped, [](const Vec3& p) {
    const auto& [x, y, z] = p;
    const double nu = 0.33;
    return Vec3{x * z, -nu * y * z, -(x * x + nu * (z * z - y * y)) / 2};
  });
  EXPECT_GT(parts.energy, 0);
  EXPECT_LT(parts.interpolation, 1e-9 * parts.energy);
}

TEST(Tractions, on_the_free_surface_count_as_the_energy_of_a_layer_that_takes_them_away) {
  // A uniformly stretched bar with free ends: sigma^2 / (lambda + 2 mu) at both ends, to a depth of an eighth of the smaller of the
  // elements' 10 mm height and the root of their face's area, 0.5 x 15 x 12 mm^2.
  const Solved solved = solve_by_hand("bar", -1, MeshKind::T10, 0);
  const double nu = 0.33, e = 70e9, modulus = e * (1 - nu) / (1 + nu) / (1 - 2 * nu);
  const auto stretch = [&](const Vec3& p) { return Vec3{p[0], -nu * p[1], -nu * p[2]}; };
  const double depth = std::sqrt(0.5 * 0.015 * 0.012) / 8, ends = 2 * 0.03 * 0.012;
  EXPECT_NEAR(estimate_field(solved, job::Mass::consistent, stretch).interpolation / (depth * ends * e * e / modulus / 1e6), 1, 1e-4);
  EXPECT_LT(estimate_field(solved, job::Mass::lumped, stretch).interpolation, 1e-9 * e * 0.3 * 0.03 * 0.012 / 1e6);
}

TEST(Prediction, of_the_bars_on_a_finer_mesh_is_right_to_a_factor_of_two) {
  // Most of the bars: where modes of two kinds are close, those on the finer mesh still depend on their neighbours.
  int good = 0;
  const Outcome coarse = solve(PETSC_COMM_WORLD, get_body("cube"), 6, MeshKind::T4),
                fine = solve(PETSC_COMM_WORLD, get_body("cube"), 10, MeshKind::T4);
  for (std::size_t m = 0; m < coarse.true_hz.size(); ++m) {
    const error_bars::Level& level = coarse.bars.level;
    const double predicted = error_bars::calc_cents(error_bars::predict_parts(level.parts[m], level.kind, 2, 0.6), level.kind);
    const double bar = fine.bars.discretisation_cents[m];
    good += predicted > bar / 2 && predicted < bar * 2 ? 1 : 0;
  }
  EXPECT_GE(good, 16);  // of 24
}

TEST(Arguments, that_do_not_fit_are_refused_on_every_rank) {
  Solved solved = solve_by_hand("box", -3, MeshKind::T4, 2);
  const std::vector<double> one{solved.modes.lambda[0]}, residual{1e-9};
  EXPECT_THROW((void)error_bars::calc_error_bars(PETSC_COMM_WORLD, solved.pieces.local, solved.system.stiffness, solved.system.mass,
                                                 std::span(&solved.solid, 1), {}, job::Mass::consistent,
                                                 {one, residual, solved.modes.shapes, 20, 1e6}),
               InputError);
}

}  // namespace
}  // namespace carillon::tests

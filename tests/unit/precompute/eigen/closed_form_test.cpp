// Bodies with closed-form eigenvalues.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/unit/precompute/eigen/spring_network.hpp"

namespace carillon::eigen {
namespace {

constexpr double kRate = 4e6;  // [N/m]
constexpr double kMass = 0.5;  // [kg]

// side^3 free masses between fixed walls, coupled isotropically to their neighbours: lambda = 4 k/m sum_d sin^2(pi j_d / (2 (side + 1))),
// j_d = 1 ... side, each three times. Symmetry makes up to 18 of them equal.
Network make_cube_between_walls(int side, double rate = kRate) {
  Network network;
  const int width = side + 2;
  const auto index = [&](int x, int y, int z) { return (z * width + y) * width + x; };
  for (int z = 0; z < width; ++z) {
    for (int y = 0; y < width; ++y) {
      for (int x = 0; x < width; ++x) {
        network.nodes.push_back({0.1 * x, 0.1 * y, 0.1 * z});
        network.mass_kg.push_back(kMass);
        network.component.push_back(0);
        const std::array<int, 3> at{x, y, z};
        if (std::any_of(at.begin(), at.end(), [&](int i) { return i == 0 || i == width - 1; })) network.fixed.push_back(index(x, y, z));
        if (x + 1 < width) network.springs.push_back({index(x, y, z), index(x + 1, y, z), rate, true});
        if (y + 1 < width) network.springs.push_back({index(x, y, z), index(x, y + 1, z), rate, true});
        if (z + 1 < width) network.springs.push_back({index(x, y, z), index(x, y, z + 1), rate, true});
      }
    }
  }
  return network;
}

std::vector<double> calc_cube_eigenvalues(int side, double rate = kRate) {
  std::vector<double> lambda;
  const auto square = [&](int j) {
    const double s = std::sin(std::numbers::pi * j / (2.0 * (side + 1)));
    return s * s;
  };
  for (int a = 1; a <= side; ++a) {
    for (int b = 1; b <= side; ++b) {
      for (int c = 1; c <= side; ++c) lambda.insert(lambda.end(), 3, 4 * rate / kMass * (square(a) + square(b) + square(c)));
    }
  }
  std::sort(lambda.begin(), lambda.end());
  return lambda;
}

// Compares with the closed-form eigenvalues of the band.
void expect_band(const Modes& modes, const std::vector<double>& all, const Options& options) {
  std::vector<double> expected;
  for (const double lambda : all) {
    if (to_hz(lambda) >= options.low_hz * (1 - 1e-12) && to_hz(lambda) <= options.high_hz * (1 + 1e-12)) expected.push_back(lambda);
  }
  ASSERT_EQ(modes.lambda.size(), expected.size());
  EXPECT_EQ(modes.band_count, static_cast<std::int64_t>(expected.size()));
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(modes.lambda[i] / expected[i], 1.0, 1e-9) << i;
  for (const double residual : modes.residual) EXPECT_LE(residual, options.tolerance);
  EXPECT_LT(modes.orthonormality_error, 1e-10);
}

TEST(SolveModes, gives_a_molecule_of_four_masses_its_six_vibrations) {
  Network network;  // regular tetrahedron of springs: lambda = k/m twice, 2 k/m three times, 4 k/m once
  network.nodes = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  network.mass_kg.assign(4, kMass);
  network.component.assign(4, 0);
  for (int a = 0; a < 4; ++a) {
    for (int b = a + 1; b < 4; ++b) network.springs.push_back({a, b, kRate, false});
  }
  const test::System system = test::make_system(network);
  Options options;
  options.low_hz = 1;
  options.high_hz = 2e3;
  const Modes modes = solve_modes(system.problem, options);
  const double unit = kRate / kMass;
  expect_band(modes, {unit, unit, 2 * unit, 2 * unit, 2 * unit, 4 * unit}, options);
  EXPECT_EQ(modes.rigid_count, 6);
  EXPECT_EQ(modes.count_below_low, 6);
  EXPECT_EQ(modes.mechanism_count, 0);
}

TEST(SolveModes, finds_every_copy_of_repeated_eigenvalues) {
  const test::System system = test::make_system(make_cube_between_walls(8));
  const std::vector<double> all = calc_cube_eigenvalues(8);
  Options options;
  options.low_hz = 10;
  options.high_hz = to_hz(0.5 * (all[170] + *std::upper_bound(all.begin(), all.end(), all[170] * (1 + 1e-9))));
  expect_band(solve_modes(system.problem, options), all, options);
}

TEST(SolveModes, finds_every_copy_when_blocks_are_narrower_than_the_multiplicity) {
  Network three = make_cube_between_walls(6);
  for (int copy = 1; copy < 3; ++copy) {
    Network other = make_cube_between_walls(6);
    for (Vec3& x : other.nodes) x[0] += 3.0 * copy;
    three = test::join(three, other);
  }
  const test::System system = test::make_system(three);  // 1944 unknowns, up to 54 equal
  std::vector<double> all;
  for (const double lambda : calc_cube_eigenvalues(6)) all.insert(all.end(), 3, lambda);
  Options options;
  options.low_hz = 10;
  options.high_hz = to_hz(0.5 * (all[280] + *std::upper_bound(all.begin(), all.end(), all[280] * (1 + 1e-9))));
  const Modes modes = solve_modes(system.problem, options);
  EXPECT_GT(modes.factor.solves, 0) << "not solved by the sparse solver";
  expect_band(modes, all, options);
  std::int64_t largest = 0;
  for (const Cluster& cluster : modes.proof.clusters) largest = std::max(largest, cluster.count);
  EXPECT_EQ(largest, 54);
  EXPECT_EQ(modes.proof.rigid_per_component, (std::vector<std::int64_t>{0, 0, 0}));
}

TEST(SolveModes, counts_a_mode_on_the_end_of_the_band_as_in_it) {
  const test::System system = test::make_system(make_cube_between_walls(8));
  const std::vector<double> all = calc_cube_eigenvalues(8);
  Options options;  // both ends hit clusters of equal eigenvalues exactly
  options.low_hz = to_hz(all[3]);
  options.high_hz = to_hz(all[60]);
  for (const auto how : {Factorisation::kAutomatic, Factorisation::kMumps}) {
    options.factorisation = how;
    const Modes modes = solve_modes(system.problem, options);
    expect_band(modes, all, options);
    EXPECT_EQ(modes.count_below_low, 3);
  }
}

TEST(SolveModes, leaves_out_modes_that_lie_just_outside_the_band) {
  const test::System system = test::make_system(make_cube_between_walls(8));
  const std::vector<double> all = calc_cube_eigenvalues(8);
  for (const double away : {2e-8, 4e-7, 1e-6, 1.5e-6}) {  // of lambda
    for (const auto how : {Method::kAutomatic, Method::kDense}) {
      if (how == Method::kDense && away != 4e-7) continue;  // slow
      Options options;
      options.low_hz = to_hz(all[3] * (1 + away));
      options.high_hz = to_hz(all[60] * (1 - away));
      options.method = how;
      const Modes modes = solve_modes(system.problem, options);
      expect_band(modes, all, options);
      const auto counted = modes.proof.counts.back().below - modes.proof.counts.front().below;
      EXPECT_EQ(counted, modes.band_count) << away;
      EXPECT_EQ(modes.proof.found, modes.band_count) << away;
      EXPECT_EQ(modes.count_below_low, modes.proof.counts.front().below) << away;
    }
  }
}

// All copies below the last shift of a slice are found before the next slice begins; a group larger than a slice is handled.
TEST(SolveModes, finds_more_degenerate_modes_than_a_slice_holds) {
  int size = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  if (size > 2) GTEST_SKIP() << "two ranks suffice; more are slow on few cores";
  constexpr int kEqual = 145;
  constexpr int kOthers = 40;
  Network many;
  std::vector<double> all;
  for (int copy = 0; copy < kEqual + kOthers; ++copy) {
    const double rate = kRate * (copy < kEqual ? 1.0 : 1.0 + 0.01 * (copy - kEqual + 1));
    Network cube = make_cube_between_walls(2, rate);
    for (Vec3& x : cube.nodes) x[0] += 0.5 * copy;
    many = copy == 0 ? cube : test::join(many, cube);
    const std::vector<double> own = calc_cube_eigenvalues(2, rate);
    all.insert(all.end(), own.begin(), own.end());
  }
  std::sort(all.begin(), all.end());
  const test::System system = test::make_system(many);  // 3600 unknowns
  Options options;
  options.low_hz = 10;
  options.high_hz = to_hz(4.7 * kRate / kMass);  // the lowest group of every cube
  const Modes modes = solve_modes(system.problem, options);
  expect_band(modes, all, options);
  EXPECT_EQ(modes.band_count, 3 * (kEqual + kOthers));
  EXPECT_LE(modes.factor.factorisations, 25);
}

TEST(SolveModes, joins_slices_without_a_gap_or_a_double) {
  int size = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  if (size > 1) GTEST_SKIP() << "slices do not depend on ranks, and 600 modes are slow on more ranks than cores";
  const test::System system = test::make_system(make_cube_between_walls(9));  // 2187 unknowns
  const std::vector<double> all = calc_cube_eigenvalues(9);
  Options options;
  options.low_hz = 10;
  options.high_hz = to_hz(0.5 * (all[600] + *std::upper_bound(all.begin(), all.end(), all[600] * (1 + 1e-9))));
  options.factorisation = Factorisation::kMumps;
  expect_band(solve_modes(system.problem, options), all, options);
}

TEST(SolveModes, keeps_the_tolerance_over_seven_decades_of_eigenvalues) {
  int size = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  if (size > 2) GTEST_SKIP() << "two ranks suffice; more are slow on few cores";
  const test::System system = test::make_system(test::join(make_cube_between_walls(8), make_cube_between_walls(3, 1e-6 * kRate)));
  std::vector<double> all = calc_cube_eigenvalues(8);
  for (const double lambda : calc_cube_eigenvalues(3, 1e-6 * kRate)) all.push_back(lambda);
  std::sort(all.begin(), all.end());
  Options options;
  options.low_hz = 0.9 * to_hz(all[0]);
  options.high_hz = to_hz(0.5 * (all[340] + *std::upper_bound(all.begin(), all.end(), all[340] * (1 + 1e-9))));
  options.factorisation = Factorisation::kMumps;
  const Modes modes = solve_modes(system.problem, options);
  EXPECT_GT(modes.lambda.back() / modes.lambda.front(), 1e6);
  EXPECT_GT(modes.factor.solves, 0) << "not solved by the sparse solver";
  EXPECT_EQ(modes.above_tolerance_count, 0);
  expect_band(modes, all, options);
}

TEST(SolveModes, solves_a_band_high_in_the_spectrum_from_its_middle) {
  const test::System system = test::make_system(make_cube_between_walls(8));
  const std::vector<double> all = calc_cube_eigenvalues(8);
  Options options;
  options.low_hz = to_hz(all[260]) * 1.0001;
  options.high_hz = to_hz(all[340]) * 1.0001;
  expect_band(solve_modes(system.problem, options), all, options);
}

}  // namespace
}  // namespace carillon::eigen

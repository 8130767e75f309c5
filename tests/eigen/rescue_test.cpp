// The ways back: another factorisation where ours breaks down, another search where a run has missed modes, slices over ranks.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "precompute/eigen/local_columns.hpp"
#include "precompute/eigen/solve_modes.hpp"
#include "precompute/ldlt/factor.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/config/error.hpp"
#include "tests/eigen/spring_network.hpp"

namespace carillon::eigen {
namespace {

// Bunches of masses, each tied to all others of its bunch, on a hub: an elimination takes every bunch alone before the hub. Their masses
// are such that, with the hub held, the lowest eigenvalue of bunch j is `tuned` (1 + j spacing), j = -count/2 ... count/2.
Network make_bunches(int count, double tuned, double spacing) {
  constexpr int kBunch = 24;
  constexpr int kHub = 20;
  Network network;
  std::uint32_t state = 12345;
  const auto random = [&] {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) / 16777216.0;
  };
  const auto add_nodes = [&](int nodes, double x) {
    for (int i = 0; i < nodes; ++i) {
      network.nodes.push_back({x + random(), random(), random()});
      network.mass_kg.push_back(1);
      network.component.push_back(0);
    }
  };
  const auto tie = [](Network& to, int first_a, int last_a, int first_b, int last_b, double rate) {
    for (int a = first_a; a < last_a; ++a)
      for (int b = std::max(first_b, a + 1); b < last_b; ++b) to.springs.push_back({a, b, rate});
  };
  const int hub = count * kBunch;
  for (int j = 0; j < count; ++j) add_nodes(kBunch, 2.0 * j);
  add_nodes(kHub, 2.0 * count);
  for (int j = 0; j < count; ++j) {
    const int first = j * kBunch;
    const std::size_t springs = network.springs.size();
    tie(network, first, first + kBunch, first, first + kBunch, 1e4);
    for (int a = first; a < first + kBunch; ++a)
      for (int b = hub; b < hub + kHub; ++b)
        if (random() < 0.3) network.springs.push_back({a, b, 1e4 * (0.5 + random())});
    Network alone = network;
    alone.springs.erase(alone.springs.begin(), alone.springs.begin() + static_cast<std::ptrdiff_t>(springs));
    for (int i = 0; i < hub + kHub; ++i)
      if (i < first || i >= first + kBunch) alone.held.push_back(i);
    const double lowest = test::calc_all_eigenvalues(alone).front();
    for (int i = first; i < first + kBunch; ++i)
      network.mass_kg[static_cast<std::size_t>(i)] = lowest / (tuned * (1 + (j - count / 2) * spacing));
  }
  tie(network, hub, hub + kHub, hub, hub + kHub, 1e2);
  return network;
}

// A pivot within a bunch vanishes near the upper end of the band, and again near every shift that is tried instead, though no eigenvalue of
// the whole is near: what a factorisation that pivots across fronts does not mind, and one that stays within them cannot pass.
TEST(Fallback, goes_to_mumps_where_pivoting_within_fronts_breaks_down) {
  constexpr double kTuned = 1000;
  const Network network = make_bunches(25, kTuned, 4e-8);
  const std::vector<double> all = test::calc_all_eigenvalues(network);
  for (const double lambda : all) ASSERT_GT(std::abs(lambda / kTuned - 1), 1e-5) << "an eigenvalue of the whole";
  const test::System system = test::make_system(network);

  ldlt::Factor ours(system.problem.stiffness, system.problem.mass);
  for (const double step : {-4e-7, -2e-7, 0.0, 2e-7, 4e-7})  // the five shifts that a count tries
    EXPECT_FALSE(ours.factorise(kTuned * (1 + step))) << step << " of the way breaks nothing";
  EXPECT_TRUE(ours.factorise(kTuned * (1 + 1e-5)));

  Options options;
  options.low_hz = to_hz(100);
  options.high_hz = to_hz(kTuned * (1 - 1.4e-6));  // counts are taken a millionth above, and up to another millionth from there
  const Modes modes = solve_modes(system.problem, options);
  const std::vector<double> expected = pick(all, options.low_hz, options.high_hz);
  EXPECT_GT(expected.size(), 10u);
  expect_eigenvalues(modes, expected);
  EXPECT_NE(modes.factor.solver.find("MUMPS"), std::string::npos) << modes.factor.solver;
  EXPECT_NE(modes.proof.method.find("MUMPS"), std::string::npos) << modes.proof.method;

  options.factorisation = Factorisation::kLdlt;  // who insists on ours hears of it
  try {
    solve_modes(system.problem, options);
    ADD_FAILURE() << "solved";
  } catch (const SolveError& error) {
    EXPECT_NE(std::string(error.what()).find("singular all around"), std::string::npos) << error.what();
  }
}

// Runs of too few steps leave out what is far from their shift, and two of them in a row that find nothing end the search there. What is
// missing between two counts is then sought with a shift between them, which the proof tells: it has a count more.
TEST(Missing, modes_are_sought_between_two_counts) {
  const Network block = make_block(4, 5, 8);
  const std::vector<double> all = test::calc_all_eigenvalues(block);
  const test::System system = test::make_system(block);
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(0.5 * (all[60] + all[61]));
  int size = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  for (const char* type : {"blocklanczos", "subspace"}) {
    if (size > 1 && std::string(type) == "subspace") continue;  // slow where ranks share cores
    check(PetscOptionsSetValue(nullptr, "-eps_type", type));
    bool is_solved = false;
    for (int steps = 8; steps < 40 && !is_solved; ++steps) {  // the fewest that suffice
      check(PetscOptionsSetValue(nullptr, "-eps_max_it", std::to_string(steps).c_str()));
      try {
        const Modes modes = solve_modes(system.problem, options);
        is_solved = true;
        expect_eigenvalues(modes, pick(all, options.low_hz, options.high_hz));
        EXPECT_GT(modes.proof.counts.size(), 3u) << type << ": the ends and the first shift were enough with " << steps << " steps";
      } catch (const SolveError&) {
      }
    }
    EXPECT_TRUE(is_solved) << type;
  }
  for (const char* name : {"-eps_type", "-eps_max_it"}) check(PetscOptionsClearValue(nullptr, name));
}

// No two eigenvalues of the irregular block are equal, so that shapes can be compared one by one.
TEST(Slices, on_all_ranks_give_the_modes_of_one) {
  const Network block = make_block(6, 7, 25);
  const test::System alone = test::make_system(block, PETSC_COMM_SELF);
  const test::System shared = test::make_system(block);
  Options options;
  options.low_hz = 1;
  options.high_hz = 168;
  const Modes one = solve_modes(alone.problem, options);
  const Modes all = solve_modes(shared.problem, options);
  ASSERT_GT(one.lambda.size(), 320u) << "one slice";
  ASSERT_EQ(one.lambda.size(), all.lambda.size());
  EXPECT_GE(all.proof.counts.size(), 4u) << "both ends, and a shift in each slice";
  EXPECT_EQ(one.proof.counts.back().below, all.proof.counts.back().below);
  PetscInt first = 0;
  check(MatGetOwnershipRange(all.shapes, &first, nullptr));
  const LocalColumns expected(one.shapes);
  const LocalColumns shapes(all.shapes);
  double largest = 0, difference = 0;
  for (std::size_t j = 0; j < one.lambda.size(); ++j) {
    EXPECT_NEAR(all.lambda[j] / one.lambda[j], 1.0, 1e-10) << j;
    for (PetscInt i = 0; i < shapes.rows; ++i) {
      const double value = expected.column(static_cast<PetscInt>(j))[first + i];
      largest = std::max(largest, std::abs(value));
      difference = std::max(difference, std::abs(shapes.column(static_cast<PetscInt>(j))[i] - value));
    }
  }
  EXPECT_LT(difference, 1e-6 * largest);
}

}  // namespace
}  // namespace carillon::eigen

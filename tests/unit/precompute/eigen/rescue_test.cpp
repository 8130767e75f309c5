// Fallbacks: MUMPS if our factorisation breaks down, another search for missing modes, slices on several ranks.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "precompute/eigen/checkpoint.hpp"
#include "precompute/eigen/predict_cost.hpp"
#include "precompute/eigen/solve_modes.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/ldlt/factor.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/eigen/spring_network.hpp"

namespace carillon::eigen {
namespace {

using la::LocalColumns;

// Bunches of masses, each connected to all others of its bunch, on a hub: an elimination takes every bunch alone before the hub. With the
// hub fixed, the lowest eigenvalue of bunch j is `tuned` (1 + j spacing), j = -count/2 ... count/2.
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
      if (i < first || i >= first + kBunch) alone.fixed.push_back(i);
    const double lowest = test::calc_all_eigenvalues(alone).front();
    for (int i = first; i < first + kBunch; ++i) network.mass_kg[i] = lowest / (tuned * (1 + (j - count / 2) * spacing));
  }
  tie(network, hub, hub + kHub, hub, hub + kHub, 1e2);
  return network;
}

// A pivot within a bunch vanishes near the upper end of the band, and again near every other shift tried, though no eigenvalue of the whole
// is near: pivoting across fronts handles this, pivoting within fronts cannot.
TEST(Fallback, goes_to_mumps_where_pivoting_within_fronts_breaks_down) {
  constexpr double kTuned = 1000;
  const Network network = make_bunches(25, kTuned, 4e-8);
  const std::vector<double> all = test::calc_all_eigenvalues(network);
  for (const double lambda : all) ASSERT_GT(std::abs(lambda / kTuned - 1), 1e-5) << "an eigenvalue of the whole network";
  const test::System system = test::make_system(network);

  ldlt::Factor ours({system.problem.stiffness, system.problem.mass});
  for (const double step : {-4e-7, -2e-7, 0.0, 2e-7, 4e-7})  // the five shifts tried by a count
    EXPECT_FALSE(ours.factorise(kTuned * (1 + step))) << step << " relative to the shift: no breakdown";
  EXPECT_TRUE(ours.factorise(kTuned * (1 + 1e-5)));

  Options options;
  options.low_hz = to_hz(100);
  options.high_hz = to_hz(kTuned * (1 - 1.4e-6));  // counts are taken a millionth above, and up to another millionth beyond
  const Modes modes = solve_modes(system.problem, options);
  const std::vector<double> expected = pick(all, options.low_hz, options.high_hz);
  EXPECT_GT(expected.size(), 10u);
  expect_eigenvalues(modes, expected);
  EXPECT_NE(modes.factor.solver.find("MUMPS"), std::string::npos) << modes.factor.solver;
  EXPECT_NE(modes.proof.method.find("MUMPS"), std::string::npos) << modes.proof.method;

  options.factorisation = Factorisation::kLdlt;  // explicit choice: error instead of fallback
  tests::expect_error<SolveError>({"singular all around"}, [&] { solve_modes(system.problem, options); });
}

constexpr int kNever = 0;

// A checkpoint in memory, for solves on the same number of ranks; requests a stop at safe point number `stop_at` of every solve, from 1, or
// kNever.
class MemoryCheckpoint {
 public:
  /// Checkpoint for the next solve, which resumes from the last saved state.
  Checkpoint& begin(int stop_at) {
    asked_ = 0;
    rejected_.clear();
    checkpoint_ = {};
    checkpoint_.numbers = numbers_;
    checkpoint_.column_count = static_cast<std::int64_t>(columns_.size());
    checkpoint_.ask = [this, stop_at] { return CheckpointRequest{++asked_ == stop_at, false}; };
    checkpoint_.report_unsaved = [](bool) {};
    checkpoint_.reject = [this](const std::string& why) { rejected_ = why; };
    checkpoint_.save = [this](const std::string& numbers, const std::vector<Columns>& columns) {
      numbers_ = numbers;
      std::vector<std::vector<double>> copy;
      for (const Columns& some : columns)
        for (int j = 0; j < some.count; ++j) copy.emplace_back(some.column(j), some.column(j) + some.rows);
      columns_ = std::move(copy);
      return true;
    };
    // The solve may save before it has read everything: the initial state is copied.
    checkpoint_.read = [from = columns_](std::int64_t first, const Columns& into) {
      for (int j = 0; j < into.count; ++j) std::ranges::copy(from.at(first + j), into.column(j));
    };
    return checkpoint_;
  }
  void append(const char* bytes) { numbers_ += bytes; }
  bool is_empty() const { return numbers_.empty(); }
  bool has_columns() const { return !columns_.empty(); }
  const std::string& why_rejected() const { return rejected_; }

 private:
  Checkpoint checkpoint_;
  std::string numbers_;
  std::vector<std::vector<double>> columns_;
  std::string rejected_;
  int asked_ = 0;
};

// The modes, or nullopt if the solve was stopped.
std::optional<Modes> solve_until_stopped(const Problem& problem, Options options, Checkpoint& checkpoint) {
  options.checkpoint = &checkpoint;
  try {
    return solve_modes(problem, options);
  } catch (const Stopped&) {
    return std::nullopt;
  }
}

// Same bank: modes, proof, and solver.
void expect_same_modes(const Modes& modes, const Modes& expected) {
  ASSERT_EQ(modes.lambda.size(), expected.lambda.size());
  for (std::size_t j = 0; j < modes.lambda.size(); ++j) EXPECT_NEAR(modes.lambda[j] / expected.lambda[j], 1.0, 1e-12) << j;
  const LocalColumns shapes(modes.shapes), known(expected.shapes);
  double largest = 0, difference = 0;
  for (std::size_t j = 0; j < modes.lambda.size(); ++j)
    for (PetscInt i = 0; i < shapes.rows; ++i) {
      const double value = known.column(static_cast<PetscInt>(j))[i];
      largest = std::max(largest, std::abs(value));
      difference = std::max(difference, std::abs(shapes.column(static_cast<PetscInt>(j))[i] - value));
    }
  EXPECT_LE(difference, 1e-7 * largest);
  EXPECT_EQ(modes.factor.solver, expected.factor.solver);
  EXPECT_EQ(modes.factor.ordering, expected.factor.ordering);
  EXPECT_EQ(modes.factor.entries, expected.factor.entries);
  EXPECT_EQ(modes.proof.method, expected.proof.method);
  EXPECT_EQ(modes.proof.found, expected.proof.found);
  EXPECT_EQ(modes.band_count, expected.band_count);
  EXPECT_EQ(modes.count_below_low, expected.count_below_low);
  EXPECT_NEAR(modes.proof.factor_backward_error, expected.proof.factor_backward_error, 1e-6 * expected.proof.factor_backward_error);
  ASSERT_EQ(modes.proof.counts.size(), expected.proof.counts.size());
  for (std::size_t i = 0; i < modes.proof.counts.size(); ++i) {
    EXPECT_EQ(modes.proof.counts[i].freq_hz, expected.proof.counts[i].freq_hz) << i;
    EXPECT_EQ(modes.proof.counts[i].below, expected.proof.counts[i].below) << i;
  }
}

// A count switches to MUMPS: the first one, at the upper end of the band, or the second, at the lower end, after one count by our
// factorisation. A solve stopped before or after that, once or at every safe point, gives the same modes and proof as an uninterrupted one,
// and does not try our factorisation again after the switch.
TEST(Fallback, resumes_from_a_checkpoint) {
  const Network block = make_block(6, 7, 11);
  const std::vector<double> all = test::calc_all_eigenvalues(block);
  const test::System system = test::make_system(block);
  for (const bool is_upper : {true, false}) {
    SCOPED_TRACE(is_upper ? "turned at the upper end" : "turned at the lower end");
    Options options;
    options.low_hz = to_hz(0.5 * (all[40] + all[41]));
    options.high_hz = to_hz(0.5 * (all[60] + all[61]));
    const double end_hz = is_upper ? options.high_hz : options.low_hz;
    options.refused_shifts_hz = {0.9999 * end_hz, 1.0001 * end_hz};
    const Modes whole = solve_modes(system.problem, options);
    ASSERT_NE(whole.factor.solver.find("MUMPS"), std::string::npos) << whole.factor.solver;
    expect_eigenvalues(whole, pick(all, options.low_hz, options.high_hz));

    bool was_iterating = false;
    for (int stop_at = 1;; ++stop_at) {
      SCOPED_TRACE("stopped at safe point " + std::to_string(stop_at));
      MemoryCheckpoint memory;
      if (solve_until_stopped(system.problem, options, memory.begin(stop_at))) {
        EXPECT_GT(stop_at, 4) << "a safe point after either count, and in the iteration";
        break;
      }
      ASSERT_FALSE(memory.is_empty());
      was_iterating = was_iterating || memory.has_columns();
      const std::optional<Modes> modes = solve_until_stopped(system.problem, options, memory.begin(kNever));
      ASSERT_TRUE(modes.has_value());
      EXPECT_EQ(memory.why_rejected(), "");
      expect_same_modes(*modes, whole);
      const int in_vain = is_upper || stop_at > 1 ? 5 : 0;  // the saved state has switched
      EXPECT_LT(modes->factor.factorisations, whole.factor.factorisations - in_vain);
    }
    EXPECT_TRUE(was_iterating);

    MemoryCheckpoint memory;
    std::optional<Modes> modes;
    int stops = 0;
    for (; !modes && stops < 1000; ++stops) modes = solve_until_stopped(system.problem, options, memory.begin(1));
    EXPECT_GT(stops, 4);
    ASSERT_TRUE(modes.has_value());
    expect_same_modes(*modes, whole);

    // A rejected state has no effect: the solve begins with our factorisation again, and switches again.
    MemoryCheckpoint damaged;
    EXPECT_FALSE(solve_until_stopped(system.problem, options, damaged.begin(3)).has_value());
    damaged.append("x");
    modes = solve_until_stopped(system.problem, options, damaged.begin(kNever));
    EXPECT_NE(damaged.why_rejected(), "");
    ASSERT_TRUE(modes.has_value());
    expect_same_modes(*modes, whole);
    EXPECT_EQ(modes->factor.factorisations, whole.factor.factorisations);
  }
}

// Runs with too few steps miss modes far from their shift, and two successive runs without new modes end the search there. The missing
// modes are then searched with a shift between two counts, which adds a count to the proof.
TEST(Missing, modes_are_searched_between_two_counts) {
  const Network block = make_block(4, 5, 8);
  const std::vector<double> all = test::calc_all_eigenvalues(block);
  const test::System system = test::make_system(block);
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(0.5 * (all[60] + all[61]));
  bool is_solved = false;
  for (options.max_steps = 8; options.max_steps < 40 && !is_solved; ++options.max_steps) {  // the fewest sufficient steps
    try {
      const Modes modes = solve_modes(system.problem, options);
      is_solved = true;
      expect_eigenvalues(modes, pick(all, options.low_hz, options.high_hz));
      EXPECT_GT(modes.proof.counts.size(), 3u) << "the counts at the ends and the first shift sufficed with " << options.max_steps
                                               << " steps";
    } catch (const SolveError&) {
    }
  }
  EXPECT_TRUE(is_solved);
}

// The irregular block has distinct eigenvalues, so shapes can be compared individually.
TEST(Slices, on_all_ranks_give_the_modes_of_one) {
  const Network block = make_block(6, 7, 25);
  const test::System alone = test::make_system(block, PETSC_COMM_SELF);
  const test::System shared = test::make_system(block);
  Options options;
  options.low_hz = 1;
  options.high_hz = 195;
  const Modes one = solve_modes(alone.problem, options);
  const Modes all = solve_modes(shared.problem, options);
  ASSERT_GT(one.lambda.size(), static_cast<std::size_t>(kSliceModes)) << "one slice";
  EXPECT_LT(all.orthonormality_error, 5e-11) << "across slices too";
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

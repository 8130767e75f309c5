// The proof, and independence of the modes from ranks, partition and rounding.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/eigen/spring_network.hpp"

namespace carillon::eigen {
namespace {

using la::LocalColumns;

TEST(Proof, agrees_with_dense_lapack) {
  const Network two = test::join(make_block(4, 4, 9), make_block(3, 4, 8, {50, 0, 0}));
  const std::vector<double> all = test::calc_all_eigenvalues(two);
  const test::System system = test::make_system(two);
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(0.5 * (all[90] + all[91]));
  const Modes modes = solve_modes(system.problem, options);
  const Proof& proof = modes.proof;
  ASSERT_EQ(proof.counts.size(), 3u) << "both ends and the shift";
  for (const Count& count : proof.counts) {
    const auto below = std::count_if(all.begin(), all.end(), [&](double x) { return x < std::pow(count.freq_hz * 2 * M_PI, 2); });
    EXPECT_EQ(count.below, below) << count.freq_hz;
    double margin = 1e9;
    const double lambda = std::pow(count.freq_hz * 2 * M_PI, 2);
    for (const double found : modes.lambda) margin = std::min(margin, std::abs(found - lambda) / lambda);
    EXPECT_NEAR(count.margin / margin, 1.0, 1e-6);
  }
  EXPECT_TRUE(
      std::is_sorted(proof.counts.begin(), proof.counts.end(), [](const Count& a, const Count& b) { return a.freq_hz < b.freq_hz; }));
  EXPECT_LE(proof.counts.front().freq_hz, options.low_hz);
  EXPECT_GE(proof.counts.back().freq_hz, options.high_hz);
  EXPECT_EQ(proof.found, 91 - 12);
  EXPECT_EQ(proof.rigid_per_component, (std::vector<std::int64_t>{6, 6}));
  EXPECT_TRUE(proof.clusters.empty());
  EXPECT_LT(proof.factor_backward_error, 1e-10);
  EXPECT_NE(proof.method.find("L D L^T"), std::string::npos) << proof.method;
}

// All modes up to a higher end, of which the lower ones are known: two more factorisations, the same modes, and one proof for all.
TEST(Proof, of_a_continued_band_is_of_the_whole_band) {
  const Network two = test::join(make_block(4, 4, 9), make_block(3, 4, 8, {50, 0, 0}));
  const std::vector<double> all = test::calc_all_eigenvalues(two);
  const test::System system = test::make_system(two);
  for (const double low_hz : {0.0, to_hz(0.5 * (all[20] + all[21]))}) {
    const std::size_t first = low_hz > 0 ? 21 : 12;
    Options options;
    options.low_hz = low_hz > 0 ? low_hz : 1.0;
    options.high_hz = to_hz(0.5 * (all[90] + all[91]));
    const Modes lower = solve_modes(system.problem, options);
    options.known = &lower;
    options.high_hz = to_hz(0.5 * (all[130] + all[131]));
    const Modes modes = solve_modes(system.problem, options);
    expect_eigenvalues(modes, {all.begin() + static_cast<std::ptrdiff_t>(first), all.begin() + 131});
    EXPECT_EQ(modes.band_count, 131 - static_cast<std::int64_t>(first));
    EXPECT_EQ(modes.count_below_low, static_cast<std::int64_t>(first));
    EXPECT_EQ(modes.factor.factorisations, lower.factor.factorisations + 2);
    EXPECT_LT(modes.orthonormality_error, 1e-10);
    EXPECT_LE(*std::max_element(modes.residual.begin(), modes.residual.end()), options.tolerance);
    EXPECT_GE(modes.proof.counts.size(), lower.proof.counts.size() + 2);
    for (const Count& count : modes.proof.counts)
      EXPECT_EQ(count.below, std::count_if(all.begin(), all.end(), [&](double x) { return x < std::pow(count.freq_hz * 2 * M_PI, 2); }));
  }
}

// A low end of the band is not counted: the shift inside proves that only the rigid modes are below.
TEST(Proof, leaves_a_low_end_to_the_shift_inside) {
  const Network block = make_block(4, 5, 9);
  const std::vector<double> all = test::calc_all_eigenvalues(block);
  const test::System system = test::make_system(block);
  Options options;
  options.high_hz = to_hz(0.5 * (all[80] + all[81]));
  options.low_hz = 0.009 * options.high_hz;
  const Modes low = solve_modes(system.problem, options);
  EXPECT_EQ(low.factor.factorisations, 2);
  EXPECT_NE(low.proof.method.find("first shift"), std::string::npos) << low.proof.method;
  options.low_hz = 0.011 * options.high_hz;
  const Modes high = solve_modes(system.problem, options);
  EXPECT_EQ(high.factor.factorisations, 3);
  EXPECT_EQ(high.proof.method.find("first shift"), std::string::npos) << high.proof.method;
  for (const Modes* modes : {&low, &high}) {
    expect_eigenvalues(*modes, {all.begin() + 6, all.begin() + 81});
    ASSERT_EQ(modes->proof.counts.size(), 3u);
    EXPECT_EQ(modes->proof.counts[0].below, 6);
    EXPECT_EQ(modes->proof.counts[2].below, 81);
    EXPECT_EQ(modes->count_below_low, 6);
  }
}

// Two blocks connected by threads: six modes that are not rigid, far below the others.
// `stiffness`: of a thread [N/m].
Network make_threaded_blocks(double stiffness) {
  Network two = test::join(make_block(4, 4, 9), make_block(3, 4, 8, {12, 0.5, 0.7}));
  const int first = 4 * 4 * 9;
  std::fill(two.component.begin(), two.component.end(), 0);
  for (int k = 0; k < 24; ++k) two.springs.push_back({(37 * k) % first, first + (29 * k) % (3 * 4 * 8), stiffness});
  return two;
}

// The six modes are too far below the band to be searched, so the lower end is counted.
TEST(Proof, counts_a_low_end_with_modes_below_it) {
  const Network two = make_threaded_blocks(1e-6);
  const std::vector<double> all = test::calc_all_eigenvalues(two);
  const test::System system = test::make_system(two);
  Options options;
  options.high_hz = to_hz(0.5 * (all[90] + all[91]));
  options.low_hz = 0.009 * options.high_hz;
  ASSERT_LT(to_hz(all[6]), 0.1 * options.low_hz);
  ASSERT_LT(to_hz(all[11]), 0.5 * options.low_hz);
  ASSERT_GT(to_hz(all[12]), options.low_hz);
  ASSERT_GT(all[6], 1e-12) << "not rigid";
  for (const std::optional<std::int64_t> most : {std::optional<std::int64_t>{}, std::optional<std::int64_t>{30}}) {
    options.max_modes = most;
    const Modes modes = solve_modes(system.problem, options);
    expect_eigenvalues(modes, {all.begin() + 12, all.begin() + (most ? 12 + *most : 91)});
    EXPECT_EQ(modes.rigid_count, 6);
    EXPECT_EQ(modes.count_below_low, 12);
    EXPECT_EQ(modes.proof.counts.front().below, 12);
    EXPECT_LE(modes.proof.counts.front().freq_hz, options.low_hz);
    EXPECT_EQ(modes.proof.method.find("first shift"), std::string::npos) << modes.proof.method;
  }
}

// Modes a little below the band are found with those of the band: no factorisation at its lower end.
TEST(Proof, finds_modes_just_below_the_band) {
  const Network two = make_threaded_blocks(100);
  const std::vector<double> all = test::calc_all_eigenvalues(two);
  const test::System system = test::make_system(two);
  Options options;
  options.high_hz = to_hz(0.5 * (all[90] + all[91]));
  options.low_hz = 0.5 * (to_hz(all[8]) + to_hz(all[9]));
  ASSERT_GT(to_hz(all[6]), 0.1 * options.low_hz);
  const Modes modes = solve_modes(system.problem, options);
  expect_eigenvalues(modes, {all.begin() + 9, all.begin() + 91});
  EXPECT_EQ(modes.count_below_low, 9);
  EXPECT_EQ(modes.mechanism_count, 0);
  EXPECT_NE(modes.proof.method.find("first shift"), std::string::npos) << modes.proof.method;
  EXPECT_EQ(modes.factor.factorisations, 2) << "at the upper end and at the shift";
}

TEST(Proof, counts_a_small_body_by_its_whole_spectrum) {
  const test::System system = test::make_system(make_block(3, 3, 4));
  Options options;
  options.low_hz = 1;
  options.high_hz = 1000;
  const Modes modes = solve_modes(system.problem, options);
  EXPECT_NE(modes.proof.method.find("dense"), std::string::npos);
  EXPECT_EQ(modes.proof.counts.front().below, 6);
  EXPECT_EQ(modes.proof.counts.back().below, 6 + modes.proof.found);
}

// Shapes of all modes on every rank, (nodes, 3, modes) in the original order of nodes.
std::vector<double> gather_shapes(const Modes& modes, MPI_Comm comm, const std::vector<int>& place) {
  const LocalColumns shapes(modes.shapes);
  const auto nodes = place.size();
  PetscInt first = 0;
  check(MatGetOwnershipRange(modes.shapes, &first, nullptr));
  std::vector<double> rows(3 * nodes * modes.lambda.size(), 0.0);
  for (std::size_t j = 0; j < modes.lambda.size(); ++j) {
    for (PetscInt i = 0; i < shapes.rows; ++i)
      rows[j * 3 * nodes + static_cast<std::size_t>(first + i)] = shapes.column(static_cast<PetscInt>(j))[i];
  }
  MPI_Allreduce(MPI_IN_PLACE, rows.data(), static_cast<int>(rows.size()), MPI_DOUBLE, MPI_SUM, comm);
  std::vector<double> ordered(rows.size());
  for (std::size_t j = 0; j < modes.lambda.size(); ++j) {
    for (std::size_t i = 0; i < nodes; ++i) {
      for (std::size_t d = 0; d < 3; ++d) ordered[(j * nodes + i) * 3 + d] = rows[(j * nodes + static_cast<std::size_t>(place[i])) * 3 + d];
    }
  }
  return ordered;
}

TEST(Canonical, modes_are_the_same_for_any_ranks_and_partition) {
  // Three equal bodies: every mode three times; a fourth that differs by a billionth is degenerate with them.
  Network network = test::join(test::join(make_block(4, 4, 6), make_block(4, 4, 6, {30, 0, 0})), make_block(4, 4, 6, {0, 40, 0}));
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(test::calc_all_eigenvalues(make_block(4, 4, 6))[36] * 1.0001);
  std::vector<int> place(network.nodes.size());
  std::iota(place.begin(), place.end(), 0);
  const test::System alone = test::make_system(network, PETSC_COMM_SELF);
  const Modes reference = solve_modes(alone.problem, options);
  const std::vector<double> expected = gather_shapes(reference, PETSC_COMM_SELF, place);
  ASSERT_EQ(reference.lambda.size(), 93u);
  EXPECT_EQ(reference.proof.clusters.size(), 31u);

  const auto count = static_cast<int>(place.size());
  for (const int stride : {1, 7, 125}) {  // None divides 288.
    if (stride == 125 && count % 5 == 0) continue;
    for (int i = 0; i < count; ++i) place[i] = static_cast<int>((static_cast<std::int64_t>(i) * stride) % count);
    const test::System system = test::make_system(test::reorder(network, place));
    const Modes modes = solve_modes(system.problem, options);
    ASSERT_EQ(modes.lambda.size(), reference.lambda.size());
    for (std::size_t j = 0; j < modes.lambda.size(); ++j) EXPECT_NEAR(modes.lambda[j] / reference.lambda[j], 1.0, 1e-10) << j;
    const std::vector<double> shapes = gather_shapes(modes, PETSC_COMM_WORLD, place);
    double largest = 0;
    double difference = 0;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      largest = std::max(largest, std::abs(expected[i]));
      difference = std::max(difference, std::abs(shapes[i] - expected[i]));
    }
    EXPECT_LT(difference, 1e-6 * largest) << "stride " << stride;
    ASSERT_EQ(modes.proof.clusters.size(), reference.proof.clusters.size());
    for (std::size_t c = 0; c < modes.proof.clusters.size(); ++c) EXPECT_EQ(modes.proof.clusters[c].count, 3);
  }
}

TEST(Canonical, part_of_a_group_that_max_modes_cuts_is_the_same_as_in_the_whole_group) {
  const Network three = test::join(test::join(make_block(4, 4, 6), make_block(4, 4, 6, {30, 0, 0})), make_block(4, 4, 6, {0, 40, 0}));
  const test::System system = test::make_system(three);
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(test::calc_all_eigenvalues(make_block(4, 4, 6))[12] * 1.0001);
  const Modes whole = solve_modes(system.problem, options);
  options.max_modes = 4;  // cuts the second group of three
  const Modes part = solve_modes(system.problem, options);
  ASSERT_EQ(part.lambda.size(), 4u);
  ASSERT_EQ(part.proof.clusters.size(), 1u);
  const LocalColumns expected(whole.shapes);
  const LocalColumns shapes(part.shapes);
  double difference = 0;
  double largest = 0;
  for (PetscInt i = 0; i < shapes.rows; ++i) {
    difference = std::max(difference, std::abs(shapes.column(3)[i] - expected.column(3)[i]));
    largest = std::max(largest, std::abs(expected.column(3)[i]));
  }
  MPI_Allreduce(MPI_IN_PLACE, &difference, 1, MPI_DOUBLE, MPI_MAX, PETSC_COMM_WORLD);
  MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, PETSC_COMM_WORLD);
  EXPECT_LT(difference, 1e-6 * largest);
}

TEST(Memory, shortage_is_an_error_before_the_work) {
  const test::System system = test::make_system(make_block(5, 5, 10));
  Options options;
  options.low_hz = 1;
  options.high_hz = 100;
  options.memory_limit_bytes = 1;
  for (const auto how : {Factorisation::kAutomatic, Factorisation::kMumps}) {
    options.factorisation = how;
    tests::expect_error<SystemError>({"GB", "coarser mesh"}, [&] { solve_modes(system.problem, options); });
  }
}

}  // namespace
}  // namespace carillon::eigen

// solve_modes for any body, against the dense solver of LAPACK on the same springs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "precompute/eigen/predict_cost.hpp"
#include "precompute/eigen/solve_modes.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/eigen/spring_network.hpp"

namespace carillon::eigen {
namespace {

// The block used by most tests: 5 x 5 x 10 free masses, 750 unknowns; the band holds about its lowest 60 modes.
const Network& get_block() {
  static const Network block = make_block(5, 5, 10);
  return block;
}
const std::vector<double>& get_block_eigenvalues() {
  static const std::vector<double> all = test::calc_all_eigenvalues(get_block());
  return all;
}
Options make_options() {
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(0.5 * (get_block_eigenvalues()[70] + get_block_eigenvalues()[71]));
  return options;
}

TEST(SolveModes, agrees_with_dense_lapack_on_a_free_body) {
  const test::System system = test::make_system(get_block());
  const Options options = make_options();
  const Modes modes = solve_modes(system.problem, options);
  expect_eigenvalues(modes, pick(get_block_eigenvalues(), options.low_hz, options.high_hz));
  EXPECT_EQ(modes.lambda.size(), 65u);
  EXPECT_EQ(modes.rigid_count, 6);
  EXPECT_EQ(modes.count_below_low, 6);
  EXPECT_GT(modes.factor.solves, 0) << "not solved by the sparse solver";
}

TEST(LowEnd, is_left_to_the_first_shift_where_it_is_far_below_the_upper_end) {
  Options options;
  EXPECT_TRUE(can_assume_low_end(options));
  options.max_modes = 5;
  EXPECT_FALSE(can_assume_low_end(options));
  options.max_modes.reset();
  options.low_hz = options.high_hz / 99;
  EXPECT_FALSE(can_assume_low_end(options));
}

TEST(SolveModes, keeps_residuals_that_an_independent_calculation_confirms) {
  const test::System system = test::make_system(get_block());
  const Options options = make_options();
  const Modes modes = solve_modes(system.problem, options);
  petsc::VecHandle k;
  petsc::VecHandle m;
  check(MatCreateVecs(system.stiffness, k.out(), m.out()));
  for (std::size_t j = 0; j < modes.lambda.size(); ++j) {
    Vec phi = nullptr;
    check(MatDenseGetColumnVecRead(modes.shapes, static_cast<PetscInt>(j), &phi));
    check(MatMult(system.stiffness, phi, k));
    check(MatMult(system.mass, phi, m));
    PetscScalar norm = 0;
    PetscReal scale = 0;
    PetscReal rest = 0;
    check(VecDot(phi, m, &norm));
    check(VecNorm(m, NORM_2, &scale));
    check(VecAXPY(k, -modes.lambda[j], m));
    check(VecNorm(k, NORM_2, &rest));
    check(MatDenseRestoreColumnVecRead(modes.shapes, static_cast<PetscInt>(j), &phi));
    EXPECT_NEAR(norm, 1.0, 1e-12);
    EXPECT_LE(rest / (modes.lambda[j] * scale), options.tolerance);
    EXPECT_NEAR(rest / (modes.lambda[j] * scale), modes.residual[j], 1e-12 + 0.1 * modes.residual[j]);
  }
}

TEST(SolveModes, does_not_change_the_matrices) {
  const test::System system = test::make_system(get_block());
  petsc::MatHandle k;
  petsc::MatHandle m;
  check(MatDuplicate(system.stiffness, MAT_COPY_VALUES, k.out()));
  check(MatDuplicate(system.mass, MAT_COPY_VALUES, m.out()));
  solve_modes(system.problem, make_options());
  PetscBool same_k = PETSC_FALSE;
  PetscBool same_m = PETSC_FALSE;
  check(MatEqual(k, system.stiffness, &same_k));
  check(MatEqual(m, system.mass, &same_m));
  EXPECT_TRUE(same_k);
  EXPECT_TRUE(same_m);
}

TEST(SolveModes, orients_every_shape_by_its_largest_entry) {
  const test::System system = test::make_system(get_block());
  const Modes modes = solve_modes(system.problem, make_options());
  for (std::size_t j = 0; j < modes.lambda.size(); ++j) {
    Vec phi = nullptr;
    PetscReal largest = 0;
    PetscReal smallest = 0;
    check(MatDenseGetColumnVecRead(modes.shapes, static_cast<PetscInt>(j), &phi));
    check(VecMax(phi, nullptr, &largest));
    check(VecMin(phi, nullptr, &smallest));
    check(MatDenseRestoreColumnVecRead(modes.shapes, static_cast<PetscInt>(j), &phi));
    EXPECT_GE(largest, -smallest * (1 - 1e-3)) << j;
  }
}

TEST(SolveModes, gives_two_equal_bodies_every_mode_twice) {
  const Network two = test::join(make_block(4, 4, 8), make_block(4, 4, 8, {50, 0, 0}));
  const std::vector<double> one = test::calc_all_eigenvalues(make_block(4, 4, 8));
  const test::System system = test::make_system(two);
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(0.5 * (one[60] + one[61]));
  const Modes modes = solve_modes(system.problem, options);
  std::vector<double> expected;
  for (const double lambda : pick(one, options.low_hz, options.high_hz)) expected.insert(expected.end(), 2, lambda);
  expect_eigenvalues(modes, expected);
  EXPECT_EQ(modes.rigid_count, 12);
  EXPECT_EQ(modes.count_below_low, 12);
}

TEST(SolveModes, handles_bodies_fixed_at_none_to_three_points) {
  const std::vector<std::vector<int>> fixed_nodes{{}, {0}, {0, 249}, {0, 4, 249}};
  const std::vector<std::int64_t> rigid{6, 3, 1, 0};
  for (std::size_t i = 0; i < fixed_nodes.size(); ++i) {
    Network network = get_block();
    network.fixed = fixed_nodes[i];
    const std::vector<double> all = test::calc_all_eigenvalues(network);
    const test::System system = test::make_system(network);
    Options options;
    options.low_hz = 1;
    options.high_hz = to_hz(0.5 * (all[50] + all[51]));
    const Modes modes = solve_modes(system.problem, options);
    EXPECT_EQ(modes.rigid_count, rigid[i]);
    EXPECT_EQ(modes.lambda.size(), 51u - static_cast<std::size_t>(rigid[i]));
    expect_eigenvalues(modes, pick(all, options.low_hz, options.high_hz));
  }
}

TEST(SolveModes, reports_parts_that_hang_on_one_point_as_mechanism) {
  Network two = test::join(make_block(4, 4, 6), make_block(4, 4, 6, {3, 3, 5}));  // The corner masses 95 and 96 coincide:
  for (test::Spring& spring : two.springs) {                                      // join them.
    if (spring.a == 96) spring.a = 95;
    if (spring.b == 96) spring.b = 95;
  }
  two.nodes.erase(two.nodes.begin() + 96);
  two.mass_kg.erase(two.mass_kg.begin() + 96);
  two.component.assign(two.nodes.size(), 0);
  for (test::Spring& spring : two.springs) {
    if (spring.a > 96) --spring.a;
    if (spring.b > 96) --spring.b;
  }
  const std::vector<double> all = test::calc_all_eigenvalues(two);
  const test::System system = test::make_system(two);
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(0.5 * (all[50] + all[51]));
  const Modes modes = solve_modes(system.problem, options);
  expect_eigenvalues(modes, pick(all, options.low_hz, options.high_hz));
  EXPECT_EQ(modes.rigid_count, 6);
  EXPECT_EQ(modes.mechanism_count, 3);
  EXPECT_EQ(modes.count_below_low, 9);
}

TEST(SolveModes, answers_an_empty_band_with_no_modes) {
  const test::System system = test::make_system(get_block());
  const double first_hz = to_hz(get_block_eigenvalues()[6]);
  Options options;
  options.low_hz = 0.2 * first_hz;
  options.high_hz = 0.9 * first_hz;
  const Modes modes = solve_modes(system.problem, options);
  EXPECT_TRUE(modes.lambda.empty());
  EXPECT_EQ(modes.band_count, 0);
  EXPECT_EQ(modes.shapes.get(), nullptr);
  EXPECT_EQ(modes.rigid_count, 6);
}

TEST(SolveModes, stops_at_the_lowest_max_modes) {
  const test::System system = test::make_system(get_block());
  for (const std::int64_t count : {1, 7, 40}) {
    Options options = make_options();
    options.max_modes = count;
    const Modes modes = solve_modes(system.problem, options);
    const auto* first = get_block_eigenvalues().data() + 6;
    expect_eigenvalues(modes, std::vector<double>(first, first + count));
    EXPECT_EQ(modes.band_count, 65);
  }
}

TEST(SolveModes, proves_the_lowest_max_modes_up_to_a_count_above_the_last) {
  const test::System system = test::make_system(get_block());
  Options options = make_options();
  options.max_modes = 20;
  const Modes modes = solve_modes(system.problem, options);
  const std::vector<Count>& counts = modes.proof.counts;
  EXPECT_GT(counts.back().freq_hz, to_hz(modes.lambda.back()));
  EXPECT_LE(counts.front().freq_hz, options.low_hz);
  EXPECT_GE(counts.back().below - counts.front().below, 20);
  for (const Count& count : counts) {
    const auto& all = get_block_eigenvalues();
    EXPECT_EQ(count.below, std::count_if(all.begin(), all.end(), [&](double x) { return x < std::pow(2 * M_PI * count.freq_hz, 2); }));
  }
}

TEST(SolveModes, needs_no_lower_end_to_leave_the_rigid_modes_out) {
  const test::System system = test::make_system(get_block());
  Options options = make_options();
  options.low_hz = 0;
  EXPECT_EQ(solve_modes(system.problem, options).lambda.size(), 65u);
}

TEST(SolveModes, finds_the_whole_spectrum_of_a_small_body) {
  const Network small = make_block(3, 3, 3);
  const std::vector<double> all = test::calc_all_eigenvalues(small);
  const test::System system = test::make_system(small);
  Options options;
  options.low_hz = 1;
  options.high_hz = 2 * to_hz(all.back());
  expect_eigenvalues(solve_modes(system.problem, options), std::vector<double>(all.begin() + 6, all.end()));
}

TEST(SolveModes, finds_most_of_the_spectrum_of_a_larger_body) {
  const test::System system = test::make_system(get_block());
  Options options = make_options();
  options.high_hz = to_hz(0.5 * (get_block_eigenvalues()[600] + get_block_eigenvalues()[601]));
  expect_eigenvalues(solve_modes(system.problem, options), pick(get_block_eigenvalues(), 1, options.high_hz));
}

TEST(SolveModes, agrees_between_factorisations_and_takes_an_elimination_order) {
  test::System system = test::make_system(get_block());
  const auto nodes = static_cast<std::int32_t>(get_block().nodes.size());
  for (std::int32_t i = 0; i < nodes; ++i) system.problem.nodes.elimination_position.push_back((i * 7) % nodes);  // 7 and 250 are coprime.
  const Options options = make_options();
  const Modes automatic = solve_modes(system.problem, options);
  EXPECT_NE(automatic.factor.solver.find("carillon"), std::string::npos) << automatic.factor.solver;
  Options other = options;
  other.factorisation = Factorisation::kMumps;
  const Modes modes = solve_modes(system.problem, other);
  expect_eigenvalues(modes, automatic.lambda);
  EXPECT_NE(modes.factor.solver.find("MUMPS"), std::string::npos) << modes.factor.solver;
  EXPECT_EQ(modes.factor.ordering, "METIS nested dissection (given)");
}

TEST(SolveModes, agrees_between_block_lanczos_and_krylov_schur) {
  const test::System system = test::make_system(get_block());
  Options options = make_options();
  options.method = Method::kBlockLanczos;
  const Modes block = solve_modes(system.problem, options);
  options.method = Method::kKrylovSchur;
  const Modes single = solve_modes(system.problem, options);
  expect_eigenvalues(single, block.lambda);
  expect_eigenvalues(single, pick(get_block_eigenvalues(), options.low_hz, options.high_hz));
}

// Dense matrices are faster if most of the spectrum is wanted; a wide band with a small max_modes is not such a case (docs/accuracy.md).
TEST(SolveModes, goes_dense_by_the_modes_wanted_and_not_by_the_band) {
  const test::System system = test::make_system(get_block());
  Options options = make_options();
  options.high_hz = 2 * to_hz(get_block_eigenvalues().back());
  options.max_modes = 20;
  const Modes few = solve_modes(system.problem, options);
  EXPECT_EQ(few.factor.solver.find("dense"), std::string::npos) << few.factor.solver;
  expect_eigenvalues(few, {get_block_eigenvalues().begin() + 6, get_block_eigenvalues().begin() + 26});
  EXPECT_EQ(few.band_count, 744);
  options.max_modes.reset();
  const Modes all = solve_modes(system.problem, options);
  EXPECT_NE(all.factor.solver.find("dense"), std::string::npos) << all.factor.solver;
  expect_eigenvalues(all, {get_block_eigenvalues().begin() + 6, get_block_eigenvalues().end()});
}

TEST(SolveModes, solves_densely_when_asked_to) {
  const test::System system = test::make_system(get_block());
  Options options = make_options();
  options.method = Method::kDense;
  const Modes modes = solve_modes(system.problem, options);
  expect_eigenvalues(modes, pick(get_block_eigenvalues(), options.low_hz, options.high_hz));
  EXPECT_NE(modes.factor.solver.find("dense"), std::string::npos);
  EXPECT_EQ(modes.factor.solves, 0);
}

TEST(SolveModes, names_interval_and_counts_of_missing_modes) {
  const test::System system = test::make_system(get_block());
  Options options = make_options();
  options.max_steps = 1;
  std::string message;
  try {
    solve_modes(system.problem, options);
  } catch (const SolveError& error) {
    message = error.what();
  }
  // The interval is one of those between the counts at the ends and at the shift.
  double low_hz = 0, high_hz = 0;
  unsigned long counted = 0, found = 1;
  ASSERT_EQ(std::sscanf(message.c_str(), "Between %lf and %lf Hz the inertia of K - lambda M counts %lu modes, and %lu were found", &low_hz,
                        &high_hz, &counted, &found),
            4)
      << message;
  EXPECT_GT(counted, 0u);
  EXPECT_EQ(counted, pick(get_block_eigenvalues(), low_hz, high_hz).size());
  EXPECT_EQ(found, 0u);
}

TEST(SolveModes, reports_progress_on_the_first_rank) {
  const test::System system = test::make_system(get_block());
  Options options = make_options();
  std::vector<Progress> seen;
  options.progress = [&](const Progress& progress) { seen.push_back(progress); };
  const Modes modes = solve_modes(system.problem, options);
  int rank = 0;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  if (rank != 0) {
    EXPECT_TRUE(seen.empty());
    return;
  }
  ASSERT_FALSE(seen.empty());
  EXPECT_EQ(seen.back().phase, Phase::kCheck);
  EXPECT_EQ(seen.back().modes_done, static_cast<std::int64_t>(modes.lambda.size()));
  EXPECT_EQ(seen.back().modes_wanted, 65);
}

struct BadOptions {
  const char* name;
  void (*spoil)(Problem&, Options&);
  const char* words;
};

TEST(SolveModes, refuses_bad_options_and_names_them) {
  const std::vector<BadOptions> cases{
      {"band upside down", [](Problem&, Options& o) { o.low_hz = o.high_hz + 1; }, "lower one first"},
      {"negative band", [](Problem&, Options& o) { o.low_hz = -1; }, "-1"},
      {"no modes", [](Problem&, Options& o) { o.max_modes = 0; }, "max_modes is 0"},
      {"no tolerance", [](Problem&, Options& o) { o.tolerance = 0; }, "tolerance"},
      {"short layout", [](Problem& p, Options&) { p.nodes.nodes_m.pop_back(); }, "positions"},
      {"foreign component", [](Problem& p, Options&) { p.nodes.component.front() = 5; }, "Component 5"},
      {"short order",
       [](Problem& p, Options&) {
         p.nodes.elimination_position = {0, 1};
       },
       "order has 2 of"},
  };
  for (const BadOptions& bad : cases) {
    test::System system = test::make_system(make_block(3, 3, 3));
    Options options = make_options();
    bad.spoil(system.problem, options);
    tests::expect_error<InputError>({bad.words}, [&] { solve_modes(system.problem, options); });
  }
}

TEST(SolveModes, refuses_a_mass_matrix_with_a_negative_mass) {
  Network network = get_block();
  network.mass_kg[100] = -1;
  const test::System system = test::make_system(network);
  EXPECT_THROW(solve_modes(system.problem, make_options()), SolveError);
}

}  // namespace
}  // namespace carillon::eigen

// Correction of bad modes, and division of a band into slices.
#include "precompute/eigen/refine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "precompute/eigen/slices.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/unit/precompute/eigen/spring_network.hpp"

namespace carillon::eigen {
namespace {

// Adds an error of this size, relative to the largest entry, with all frequencies, to every mode; the same for any number of ranks.
void spoil(Mat shapes, double size) {
  PetscInt first = 0;
  PetscInt last = 0;
  PetscInt modes = 0;
  check(MatGetOwnershipRange(shapes, &first, &last));
  check(MatGetSize(shapes, nullptr, &modes));
  for (PetscInt j = 0; j < modes; ++j) {
    Vec column = nullptr;
    PetscReal largest = 0;
    check(MatDenseGetColumnVec(shapes, j, &column));
    check(VecNorm(column, NORM_INFINITY, &largest));
    for (PetscInt i = first; i < last; ++i)
      check(VecSetValue(column, i, size * largest * std::sin(12.9898 * (i + 1) + 78.233 * (j + 1)), ADD_VALUES));
    check(VecAssemblyBegin(column));
    check(VecAssemblyEnd(column));
    check(MatDenseRestoreColumnVec(shapes, j, &column));
  }
}

TEST(RefineModes, brings_spoiled_modes_back_within_the_tolerance) {
  const test::Network block = test::make_block(4, 4, 8);
  const std::vector<double> all = test::calc_all_eigenvalues(block);
  const test::System system = test::make_system(block);
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(0.5 * (all[40] + all[41]));
  Modes modes = solve_modes(system.problem, options);
  ASSERT_EQ(modes.lambda.size(), 35u);
  const la::Pencil pencil{system.stiffness, system.mass};
  const Operators operators(pencil);
  const auto factor = make_mumps_factor(pencil, {});
  RefineRequest request;
  request.operators = &operators;
  request.tolerance = 1e-9;
  request.get_factor = [&]() -> ShiftedFactor& { return *factor; };
  ModeErrors errors;
  EXPECT_EQ(refine_modes(request, modes.lambda, modes.shapes, errors).factorisations, 0) << "good modes cost nothing";

  for (const double size : {1e-6, 1e-3}) {
    spoil(modes.shapes, size);
    for (double& lambda : modes.lambda) lambda *= 1 + size * size;
    errors = normalise_and_measure(operators, modes.lambda, modes.shapes);
    for (const double residual : errors.residual) ASSERT_GT(residual, request.tolerance);
    refine_modes(request, modes.lambda, modes.shapes, errors);
    EXPECT_LT(errors.orthonormality, 1e-11);
    for (std::size_t j = 0; j < modes.lambda.size(); ++j) {
      EXPECT_LE(errors.residual[j], request.tolerance) << j << " spoiled by " << size;
      EXPECT_NEAR(modes.lambda[j] / all[j + 6], 1.0, 1e-9) << j << " spoiled by " << size;
    }
  }
}

// Solves with entries wrong by one part in ten million, as from a bad factorisation.
class RoundingFactor : public ShiftedFactor {
 public:
  explicit RoundingFactor(ShiftedFactor& exact) : exact_(exact) {}
  bool try_factorise(double sigma) override { return exact_.factorise(sigma); }
  void solve(const double* b, double* x, std::ptrdiff_t stride, int columns) override {
    exact_.solve(b, x, stride, columns);
    for (std::ptrdiff_t i = 0; i < stride * columns; ++i) x[i] *= 1 + 1e-7 * std::sin(12.9898 * static_cast<double>(i + 1));
  }
  std::int64_t get_negative_pivots() const override { return exact_.get_negative_pivots(); }
  double get_backward_error() const override { return exact_.get_backward_error(); }
  std::int64_t get_peak_bytes() const override { return exact_.get_peak_bytes(); }
  std::string get_solver() const override { return exact_.get_solver(); }
  std::string get_ordering() const override { return exact_.get_ordering(); }
  std::int64_t get_entries() const override { return exact_.get_entries(); }
  double get_flops() const override { return exact_.get_flops(); }

 private:
  ShiftedFactor& exact_;
};

TEST(RefineModes, uses_the_available_factor_for_rounding_of_solves) {
  const test::Network block = test::make_block(4, 4, 8);
  const std::vector<double> all = test::calc_all_eigenvalues(block);
  const test::System system = test::make_system(block);
  Options options;
  options.low_hz = 1;
  options.high_hz = to_hz(0.5 * (all[20] + all[21]));
  Modes modes = solve_modes(system.problem, options);
  ASSERT_EQ(modes.lambda.size(), 15u);
  const la::Pencil pencil{system.stiffness, system.mass};
  const Operators operators(pencil);
  const auto factor = make_mumps_factor(pencil, {});
  RoundingFactor at_hand(*factor);
  ASSERT_TRUE(at_hand.factorise(0.5 * (all[10] + all[11])));
  RefineRequest request;
  request.operators = &operators;
  request.tolerance = 1e-9;
  request.at_hand = &at_hand;
  request.get_factor = [&]() -> ShiftedFactor& { return *factor; };
  spoil(modes.shapes, 1e-10);  // only its amplification by fast motions is above the tolerance
  ModeErrors errors = normalise_and_measure(operators, modes.lambda, modes.shapes);
  ASSERT_GT(*std::max_element(errors.residual.begin(), errors.residual.end()), 2 * request.tolerance);
  const RefineCost cost = refine_modes(request, modes.lambda, modes.shapes, errors);
  EXPECT_EQ(cost.factorisations, 0);
  EXPECT_GT(cost.solves, 0);
  EXPECT_LT(errors.orthonormality, 1e-10);
  for (std::size_t j = 0; j < modes.lambda.size(); ++j) {
    EXPECT_LE(errors.residual[j], request.tolerance) << j;
    EXPECT_NEAR(modes.lambda[j] / all[j + 6], 1.0, 1e-9) << j;
  }
}

// Sweeps a band of these eigenvalues like a solver that finds all modes of every slice; returns the modes per slice.
std::vector<std::int64_t> sweep_through(const std::vector<double>& lambda, const Slice& band, std::int64_t max, int& counts) {
  const CountBelow count = [&](double x) { return std::lower_bound(lambda.begin(), lambda.end(), x) - lambda.begin(); };
  Sweep sweep(band, max, [&](double x) {
    ++counts;
    EXPECT_GT(x, band.low);
    EXPECT_LT(x, band.high);
    return count(x);
  });
  std::vector<std::int64_t> modes;
  while (!sweep.is_last() && modes.size() < 100) {
    const double low = sweep.get_rest().low;
    const Sweep::Part part = sweep.take();
    EXPECT_EQ(part.slice.low, low);
    EXPECT_EQ(part.slice.below_low, count(low));
    EXPECT_GT(part.sigma, low);
    EXPECT_LT(part.sigma, part.slice.high);
    EXPECT_LE(part.slice.high, band.high);
    modes.push_back(count(part.slice.high) - count(low));
    sweep.advance(part.slice.high, count(part.slice.high));
  }
  EXPECT_EQ(sweep.get_rest().high, band.high);
  EXPECT_EQ(sweep.get_rest().below_high, band.below_high);
  modes.push_back(sweep.get_rest().count());
  return modes;
}

TEST(Sweep, covers_the_band_in_slices_of_about_equal_size_at_one_count_each) {
  for (const double power : {1.0, 2.0, 0.5}) {  // of frequency: plates, between plates and solids, strings in bending
    std::vector<double> lambda;
    for (int j = 1; j <= 1000; ++j) lambda.push_back(std::pow(j, 2 / power));
    int counts = 0;
    const std::vector<std::int64_t> modes = sweep_through(lambda, {0.5, 0, 1.001 * lambda.back(), 1000}, 320, counts);
    EXPECT_EQ(std::accumulate(modes.begin(), modes.end(), std::int64_t{0}), 1000);
    EXPECT_LE(modes.size(), 5u) << "frequency to the " << power;
    EXPECT_LE(counts, static_cast<int>(modes.size())) << "frequency to the " << power;
    for (const std::int64_t count : modes) EXPECT_LE(count, 400) << "frequency to the " << power;
  }
}

TEST(Sweep, takes_few_modes_at_once) {
  std::vector<double> lambda(300);
  std::iota(lambda.begin(), lambda.end(), 1.0);
  int counts = 0;
  EXPECT_EQ(sweep_through(lambda, {0.5, 0, 301, 300}, 320, counts), std::vector<std::int64_t>{300});
  EXPECT_EQ(counts, 0);
}

TEST(Sweep, goes_past_a_cluster_too_narrow_to_cut) {
  std::vector<double> lambda(1000, 1.0);
  for (int j = 1; j <= 500; ++j) lambda.push_back(1 + 0.01 * j);
  int counts = 0;
  const std::vector<std::int64_t> modes = sweep_through(lambda, {0.1, 0, 6.5, 1500}, 320, counts);
  EXPECT_EQ(std::accumulate(modes.begin(), modes.end(), std::int64_t{0}), 1500);
  EXPECT_LE(counts, 25);
}

TEST(CutToLowest, keeps_a_few_modes_more_than_wanted) {
  const CountBelow count = [](double x) { return static_cast<std::int64_t>(std::sqrt(x)); };
  const Slice cut = cut_to_lowest({1, 1, 1e6, 1000}, 40, 0, count);
  EXPECT_EQ(cut.low, 1);
  EXPECT_GE(cut.count(), 40);
  EXPECT_LE(cut.count(), 50);
  EXPECT_EQ(cut_to_lowest({1, 1, 1e6, 1000}, 999, 0, count).high, 1e6);
}

TEST(CutToLowest, takes_one_count_with_a_good_guess_and_ends_right_with_any) {
  int counts = 0;
  const CountBelow count = [&](double x) { return ++counts, static_cast<std::int64_t>(std::sqrt(x)); };
  const auto cut_from = [&](double guess) {
    counts = 0;
    return cut_to_lowest({1, 1, 1e6, 1000}, 40, guess, count);
  };
  for (const double share : {0.95, 1.0, 1.05}) {  // of the lambda of the 40th
    EXPECT_LE(std::abs(cut_from(share * 41 * 41).count() - 45), 5) << share;
    EXPECT_EQ(counts, 1) << share;
  }
  for (const double guess : {1e-9, 1.5, 9.0, 400.0, 1e4, 9.9e5, 1e6, 1e9}) {
    EXPECT_LE(std::abs(cut_from(guess).count() - 45), 5) << guess;
    EXPECT_LE(counts, 6) << guess;
  }
}

}  // namespace
}  // namespace carillon::eigen

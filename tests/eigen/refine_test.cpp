// The pieces behind solve_modes that a good solve hardly uses: mending bad modes, cutting a band.
#include "precompute/eigen/refine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "precompute/eigen/slices.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/eigen/spring_network.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;
using test::to_hz;

// Adds to every mode an error of this size relative to its largest entry, of all frequencies and the same on any number of ranks.
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
  const Operators operators(system.stiffness, system.mass);
  const auto factor = make_mumps_factor(system.stiffness, system.mass, {});
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

TEST(CutIntoSlices, covers_the_band_without_gaps_and_with_few_modes_each) {
  std::vector<double> lambda;  // 1000 modes, evenly in frequency
  for (int j = 1; j <= 1000; ++j) lambda.push_back(j * j);
  const CountBelow count = [&](double x) { return std::lower_bound(lambda.begin(), lambda.end(), x) - lambda.begin(); };
  const std::vector<Slice> slices = cut_into_slices({0.5, 0, 2e6, 1000}, 320, count);
  EXPECT_EQ(slices.front().low, 0.5);
  EXPECT_EQ(slices.back().high, 2e6);
  for (std::size_t i = 0; i < slices.size(); ++i) {
    EXPECT_LE(slices[i].count(), 320);
    EXPECT_EQ(slices[i].below_high, count(slices[i].high));
    if (i == 0) continue;
    EXPECT_EQ(slices[i].low, slices[i - 1].high);
    EXPECT_EQ(slices[i].below_low, slices[i - 1].below_high);
  }
  EXPECT_LE(slices.size(), 6u);
}

TEST(CutIntoSlices, leaves_a_cluster_too_narrow_to_cut_in_one_piece) {
  const CountBelow count = [](double x) { return x > 1.0 ? 1000 : 0; };
  std::int64_t modes = 0;
  for (const Slice& slice : cut_into_slices({0.1, 0, 4.0, 1000}, 320, count)) modes += slice.count();
  EXPECT_EQ(modes, 1000);
}

TEST(CutToLowest, keeps_a_few_modes_more_than_wanted) {
  const CountBelow count = [](double x) { return static_cast<std::int64_t>(std::sqrt(x)); };
  const Slice cut = cut_to_lowest({1, 1, 1e6, 1000}, 40, count);
  EXPECT_EQ(cut.low, 1);
  EXPECT_GE(cut.count(), 40);
  EXPECT_LE(cut.count(), 50);
  EXPECT_EQ(cut_to_lowest({1, 1, 1e6, 1000}, 999, count).high, 1e6);
}

}  // namespace
}  // namespace carillon::eigen

// The cost model: growth of its parts, and estimates of mode counts.
#include <gtest/gtest.h>

#include <cmath>

#include "precompute/job/cost/calibration.hpp"
#include "precompute/job/cost/memory.hpp"
#include "precompute/job/cost/modes.hpp"
#include "precompute/job/cost/seconds.hpp"

namespace carillon::cost {
namespace {

ProblemSize make_size(std::int64_t nodes) {
  ProblemSize size = estimate_meshed_size(nodes, true);
  size.modes = 100;
  return size;
}

TEST(ProblemSize, complete_keeps_known_values) {
  ProblemSize size = make_size(5000);
  size.factor_entries = 123;
  size.unknowns = 14000;
  const ProblemSize whole = complete(size);
  EXPECT_EQ(whole.factor_entries, 123);
  EXPECT_EQ(whole.unknowns, 14000);
  EXPECT_EQ(whole.modes, 100);
  EXPECT_EQ(whole.nodes, 5000);
  EXPECT_GT(whole.factor_flops, 0);
  EXPECT_EQ(complete(estimate_file_size(50 * 4000, false)).nodes, 1000);
  EXPECT_EQ(complete(estimate_file_size(50 * 4000, true)).nodes, 6000);
  EXPECT_EQ(estimate_file_size(50 * 4000, true, 2).tets, 64 * 4000);
}

TEST(ProblemSize, refinement_composes_and_keeps_the_modes) {
  const ProblemSize once = refine(make_size(4000), 4), twice = refine(refine(make_size(4000), 2), 2);
  EXPECT_EQ(once.modes, 100);
  EXPECT_EQ(once.unknowns, 4 * 3 * 4000);
  EXPECT_NEAR(static_cast<double>(twice.factor_entries), static_cast<double>(once.factor_entries), 2);
  EXPECT_NEAR(twice.factor_flops / once.factor_flops, 1, 1e-12);
  // A refined size costs as much as a body of that size if only the nodes are known.
  EXPECT_NEAR(predict_seconds(once).factor, predict_seconds(make_size(16000)).factor, 1e-3 * predict_seconds(once).factor);
}

TEST(ProblemSize, ten_nodes_per_tetrahedron_on_the_same_mesh) {
  ProblemSize linear = estimate_meshed_size(1000, false);
  const ProblemSize quadratic = make_quadratic(linear);
  EXPECT_EQ(quadratic.tets, linear.tets);
  EXPECT_EQ(quadratic.nodes, 6000);
  EXPECT_TRUE(quadratic.is_quadratic);
  EXPECT_GT(predict_seconds(quadratic).sum(), 4 * predict_seconds(linear).sum_modes());
}

TEST(Seconds, more_modes_and_more_nodes_cost_more) {
  ProblemSize more = make_size(5000);
  more.modes = 300;
  EXPECT_GT(predict_seconds(more).sum(), predict_seconds(make_size(5000)).sum());
  EXPECT_GT(predict_seconds(make_size(10000)).sum(), 2 * predict_seconds(make_size(5000)).sum() - 2 * kStart);
  ProblemSize thin = make_size(5000);
  thin.is_thin = true;
  EXPECT_GT(predict_seconds(thin).check,
            predict_seconds(make_size(5000)).check +
                predict_seconds(thin).factor / static_cast<double>(predict_factorisations(100, thin.counts_low_end)));
}

TEST(Seconds, coupled_modes_cost_more_time_and_memory) {
  ProblemSize size = make_size(5000);
  const double alone = predict_bytes(size, 1);
  EXPECT_EQ(predict_seconds(size).coupling, 0);
  double before = 0;
  for (const int modes : {10, 30, 60, 120}) {
    size.coupled_modes = modes;
    const PhaseSeconds seconds = predict_seconds(size);
    EXPECT_GT(seconds.coupling, before) << modes;
    EXPECT_GE(seconds.sum(), seconds.coupling);
    EXPECT_GE(predict_bytes(size, 1), alone);
    before = seconds.coupling;
  }
  EXPECT_GT(predict_bytes(size, 1), alone);
  EXPECT_EQ(predict_coupling_solves(30), 465);
}

TEST(Seconds, an_empty_band_is_counted_and_not_searched) {
  ProblemSize empty = make_size(5000);
  empty.modes = 0;
  empty.is_thin = true;
  const PhaseSeconds seconds = predict_seconds(empty), full = predict_seconds(make_size(5000));
  ProblemSize thin = empty;
  thin.modes = 100;
  EXPECT_DOUBLE_EQ(seconds.factor / 3,
                   predict_seconds(thin).factor / static_cast<double>(predict_factorisations(100, thin.counts_low_end)));
  EXPECT_EQ(seconds.write, 0);
  EXPECT_EQ(seconds.check, 0);
  EXPECT_LT(seconds.solve, full.solve);
  EXPECT_LT(predict_bytes(empty, 1), predict_bytes(make_size(5000), 1));
  // Unknown is not empty.
  ProblemSize unknown = make_size(5000);
  unknown.modes.reset();
  EXPECT_GT(predict_seconds(unknown).write, full.write);
}

TEST(Seconds, slices_of_the_spectrum) {
  EXPECT_EQ(count_slices(0), 1);
  EXPECT_EQ(count_slices(kSliceModes), 1);
  EXPECT_EQ(count_slices(kSliceModes + 1), 2);
  EXPECT_EQ(predict_factorisations(0), 3);
  EXPECT_EQ(predict_factorisations(2 * kSliceModes), 4);
  EXPECT_EQ(predict_factorisations(2 * kSliceModes, false), 3);
}

TEST(Seconds, ranks_divide_all_but_serial_work) {
  const PhaseSeconds cpu = predict_seconds(make_size(5000)), wall = calc_wall(cpu, make_size(5000), 4);
  EXPECT_DOUBLE_EQ(wall.solve, cpu.solve / 4);
  EXPECT_DOUBLE_EQ(wall.read, cpu.read);
  EXPECT_DOUBLE_EQ(wall.write, cpu.write);
  ProblemSize shared = make_size(5000);
  shared.is_read_by_all = true;
  EXPECT_DOUBLE_EQ(calc_wall(cpu, shared, 4).read, cpu.read / 4);
}

TEST(Memory, grows_with_ranks_modes_and_nodes) {
  double before = 0;
  for (const int ranks : {1, 2, 3, 4, 6, 8, 16, 1024}) {
    const double bytes = predict_bytes(make_size(5000), ranks);
    EXPECT_GT(bytes, before) << ranks;
    before = bytes;
  }
  ProblemSize more = make_size(5000);
  more.modes = 1000;
  EXPECT_GT(predict_bytes(more, 1), predict_bytes(make_size(5000), 1));
}

TEST(Memory, measured_values_replace_estimates) {
  const ProblemSize size = complete(make_size(5000));
  MemoryParts parts = predict_parts(size);
  parts.factor_peak += 1e9;
  EXPECT_NEAR(
      calc_peak_bytes(parts, size, 1),
      kRankGrowth[0] * (1e9 + parts.factor_peak - 1e9 + parts.assembled - parts.program + parts.copies) + parts.program + kRankBytes, 1);
  ProblemSize dense = size;
  dense.is_dense = true;
  constexpr double kMatrix = 8.0 * 15000 * 15000;
  EXPECT_GT(calc_peak_bytes(predict_parts(size), dense, 1), (kDenseCopies + kDenseWork) * kMatrix);
  // Every rank has copies, one rank solves.
  const double more_ranks = calc_peak_bytes(predict_parts(size), dense, 4) - calc_peak_bytes(predict_parts(size), dense, 1);
  EXPECT_GT(more_ranks, 3 * kDenseCopies * kMatrix);
  EXPECT_LT(more_ranks, 3.5 * kDenseCopies * kMatrix);
}

// Bending, torsion and stretching of a slender bar have closed forms. With a section small against the waves, the law for solids
// undercounts; the bounds must still contain the true count.
TEST(Weyl, bounds_hold_the_modes_of_a_slender_bar) {
  material::Material steel;
  steel.density_kg_m3 = 7850;
  steel.young_modulus_pa = 2e11;
  steel.poisson_ratio = 0.3;
  const double length = 0.2, width = 0.03, thickness = 0.02, high_hz = 20000;
  const double c = std::sqrt(steel.young_modulus_pa / steel.density_kg_m3);
  // Euler-Bernoulli both ways, stretching, and torsion (Saint-Venant: J = 0.196 w h^3 for w = 1.5 h).
  int count = 0;
  for (const double depth : {width, thickness})
    for (int n = 1; n < 50; ++n) {
      const double root = n == 1 ? 4.7300 : n == 2 ? 7.8532 : (n + 0.5) * M_PI;
      count += root * root / (2 * M_PI) * c * depth / std::sqrt(12.0) / (length * length) <= high_hz ? 1 : 0;
    }
  const double torsion =
      std::sqrt(1 / 2.6) * c *
      std::sqrt(0.196 * width * std::pow(thickness, 3) / (width * thickness * (width * width + thickness * thickness) / 12));
  for (int n = 1; n < 50; ++n) {
    count += n * c / (2 * length) <= high_hz ? 1 : 0;
    count += n * torsion / (2 * length) <= high_hz ? 1 : 0;
  }
  const double area = 2 * (length * width + length * thickness + width * thickness);
  const ModeEstimate estimate = estimate_modes({steel}, {length * width * thickness}, area, 20, high_hz);
  EXPECT_LE(estimate.low, count);
  EXPECT_GE(estimate.high, count);
  EXPECT_FALSE(estimate.is_thin);
  // At high frequencies the bar counts as a solid: cubes of frequency.
  const ModeEstimate more = estimate_modes({steel}, {length * width * thickness}, area, 20, 200 * high_hz);
  const ModeEstimate twice = estimate_modes({steel}, {length * width * thickness}, area, 20, 400 * high_hz);
  EXPECT_NEAR(std::log2(twice.count / more.count), 3, 0.05);
}

}  // namespace
}  // namespace carillon::cost

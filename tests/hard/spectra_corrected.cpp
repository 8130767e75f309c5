// Corrected frequencies where an estimate is hard to use, against frequencies that no mesh gave
// (tests/unit/precompute/fem/error_bars/data/known_frequencies.csv).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/sort_order.hpp"
#include "tests/hard/figure.hpp"
#include "tests/hard/spectra_body.hpp"
#include "tests/unit/precompute/fem/error_bars/bodies.hpp"

namespace carillon::hard {
namespace {

using bank::Correction;

std::vector<double> read_known(std::size_t count) {
  std::vector<double> known;
  for (const tests::Truth& truth : tests::read_truth("cube")) known.push_back(truth.freq_hz);
  known.resize(count);
  return known;
}

struct Estimated {
  Answer answer;
  error_bars::ErrorBars bars;
};

/// The cube of known_frequencies.csv in T10.
Estimated solve_cube(int cells, int modes) {
  const Body cube{shapes::make_box({0.05, 0.05, 0.05}, {cells, cells, cells}, 2), {make_solid(200e9, 0.3, 7850)}};
  eigen::Options options;
  options.low_hz = 20;
  options.high_hz = 200e3;
  options.max_modes = modes;
  Estimated found;
  found.answer = solve(PETSC_COMM_WORLD, cube, options);
  found.bars = calc_bars(PETSC_COMM_WORLD, cube, found.answer, options);
  return found;
}

double to_cents(double lambda, double hz) { return 600 * std::log2(lambda) - 1200 * std::log2(2 * std::numbers::pi * hz); }

/// |error| / bar of the worst of the known modes.
double find_worst(const error_bars::Corrections& corrections, const std::vector<double>& known) {
  const std::vector<std::size_t> order = base::find_sort_order(corrections.lambda);
  double worst = 0;
  for (std::size_t k = 0; k < known.size(); ++k)
    worst = std::max(worst, std::abs(to_cents(corrections.lambda[order[k]], known[k])) / corrections.cents[order[k]]);
  return worst;
}

TEST(spectra, corrected_clusters) {
  // 2, 3, 3, 3, 3 and 3 degenerate modes: any basis of each group's space may come out, and the parts of the estimate of a single shape
  // depend on it. The corrected frequencies may not, and they must be nearer to the truth.
  const std::string id = "corrected_clusters";
  const std::vector<double> known = read_known(17);
  const Estimated found = solve_cube(4, 24);
  const error_bars::Corrections& corrected = found.bars.corrected;
  std::vector<double> hz;
  for (const double lambda : corrected.lambda) hz.push_back(std::sqrt(lambda) / (2 * std::numbers::pi));
  hold_groups(id, "corrected", hz, 0, {2, 3, 3}, 1e-9);
  hold(id, find_worst(corrected, known), 1, "error over bar");
  std::vector<double> before, after;
  const std::vector<std::size_t> order = base::find_sort_order(corrected.lambda);
  for (std::size_t k = 0; k < known.size(); ++k) {
    before.push_back(std::abs(1200 * std::log2(found.answer.freq_hz[k] / known[k])));
    after.push_back(std::abs(to_cents(corrected.lambda[order[k]], known[k])));
  }
  std::sort(before.begin(), before.end());
  std::sort(after.begin(), after.end());
  hold(id, after[8] / before[8], 0.125, "median error over the mesh's");
}

TEST(spectra, wrong_estimate) {
  // Two meshes of one body; the estimate of both is made fifty times too small. Without the coarser mesh its bars are wrong. With it the
  // contradiction is seen: no mode is corrected by it, and the bars hold again.
  const std::string id = "wrong_estimate";
  const std::vector<double> known = read_known(17);
  const Estimated coarse = solve_cube(2, 24), fine = solve_cube(4, 24);
  const error_bars::Corrections right = error_bars::calc_corrections(fine.bars.level, std::span(&coarse.bars.level, 1));
  hold(id, static_cast<double>(std::count(right.correction.begin(), right.correction.end(), Correction::kDisputed)), 0,
       "disputed though right");
  hold(id, find_worst(right, known), 1, "error over bar, two meshes");
  error_bars::Level spoilt = fine.bars.level, spoilt_coarse = coarse.bars.level;
  for (error_bars::Level* level : {&spoilt, &spoilt_coarse})
    for (error_bars::ErrorParts& parts : level->parts) parts.interpolation /= 50;
  const error_bars::Corrections wrong = error_bars::calc_corrections(spoilt, std::span(&spoilt_coarse, 1));
  EXPECT_GT(find_worst(error_bars::calc_corrections(spoilt), known), 1.0) << "one mesh cannot know";
  int trusted = 0;
  for (std::size_t k = 0; k < known.size(); ++k) trusted += wrong.correction[k] == Correction::kDisputed ? 0 : 1;
  hold(id, trusted, 0, "trusted though wrong");
  hold(id, find_worst(wrong, known), 1, "error over bar, disputed");
}

}  // namespace
}  // namespace carillon::hard

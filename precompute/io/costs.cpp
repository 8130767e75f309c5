// Method:     Counts of what grows (elements, entries and operations of the factor, columns of the basis) times rates measured on one
//             machine, least squares over the runs of tests/bench/predict; another machine is scaled by one number, the time of a kernel.
//             Entries and operations of a factor that was not analysed yet by powers of the unknowns (George 1973: 4/3 and 2 for solids
//             without end; less for bodies of this size).
// Source:     none. Deviations: none.
#include "precompute/io/costs.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <vector>

#include "precompute/eigen/needs.hpp"

namespace carillon::io {
namespace {

constexpr std::int64_t kUsualModes = 200;  // of a band that was not counted
constexpr double kUsualEntries = 270, kUsualEntryPower = 1.33;
constexpr double kUsualFlops = 2.0e10, kUsualFlopPower = 1.7;  // of 100,000 unknowns
constexpr double kDenseRows = 300;

// CPU seconds on a Xeon of the Sapphire Rapids generation, AVX-512, two ranks of other programs beside it.
constexpr double kStart = 0.08;
constexpr double kReadTet = 1.5e-6, kReadQuadraticTet = 2e-6;
constexpr double kPartTet = 1e-6, kPartQuadraticTet = 1e-6;
constexpr double kAssembleTet = 1e-6, kAssembleQuadraticTet = 1.8e-5;
constexpr double kAnalyseRow = 6e-6, kAnalyseQuadraticRow = 1.1e-5;  // K and M by nodes, rigid modes, elimination order
constexpr double kFactorFlop = 2.2e-11, kFactorEntry = 6e-9;
constexpr double kSolveEntry = 1.5e-10;
constexpr double kBasisNumber = 1.2e-10, kSmallNumber = 4e-10;
constexpr double kCheckNumber = 2e-8, kCheckPair = 1e-10;
constexpr double kCorrected = 0.5;  // of the iteration: thin bodies have low modes that are sought once more
constexpr double kErrorMode = 1.5e-8, kErrorQuadraticMode = 9e-8, kErrorTet = 6e-6;
constexpr double kCollectNumber = 1e-8, kWriteNumber = 5e-9;

double to_double(std::int64_t value) { return static_cast<double>(value); }

}  // namespace

std::int64_t count_slices(std::int64_t modes) { return std::max<std::int64_t>(1, (modes + eigen::kSliceModes - 1) / eigen::kSliceModes); }

std::int64_t predict_solves(std::int64_t modes) { return 110 * count_slices(modes) + 2 * modes; }

std::int64_t predict_factorisations(std::int64_t modes) {
  if (modes == 0) return 3;
  return 2 + count_slices(modes);
}

Extent complete(Extent extent) {
  if (extent.nodes == 0) extent.nodes = extent.is_quadratic ? extent.tets * 3 / 2 : extent.tets / 4;
  if (extent.unknowns == 0) extent.unknowns = 3 * extent.nodes;
  if (extent.surface_nodes == 0) extent.surface_nodes = extent.nodes / 2;
  const double unknowns = to_double(std::max<std::int64_t>(extent.unknowns, 1));
  if (extent.factor_flops == 0) extent.factor_flops = kUsualFlops * std::pow(unknowns / 1e5, kUsualFlopPower);
  if (extent.factor_entries == 0)
    extent.factor_entries = static_cast<std::int64_t>(kUsualEntries * 1e5 * std::pow(unknowns / 1e5, kUsualEntryPower));
  if (extent.modes == 0) extent.modes = kUsualModes;
  return extent;
}

Costs predict_costs(const Extent& known) {
  const Extent extent = complete(known);
  const double tets = to_double(extent.tets);
  const double unknowns = to_double(extent.unknowns);
  const double modes = to_double(extent.modes);
  const double entries = to_double(extent.factor_entries);
  const double shapes = unknowns * modes;
  const double surface = 3 * to_double(extent.surface_nodes) * modes;
  const bool is_quadratic = extent.is_quadratic;
  Costs costs;
  costs.read = kStart + (extent.read_seconds > 0 ? extent.read_seconds : (is_quadratic ? kReadQuadraticTet : kReadTet) * tets);
  costs.partition = (is_quadratic ? kPartQuadraticTet : kPartTet) * tets;
  costs.assemble = (is_quadratic ? kAssembleQuadraticTet : kAssembleTet) * tets;
  costs.errors = (is_quadratic ? kErrorQuadraticMode : kErrorMode) * tets * modes + kErrorTet * tets;
  costs.collect = kCollectNumber * surface;
  costs.write = kWriteNumber * surface;
  if (unknowns <= kDenseRows) return costs;
  const double solves = to_double(predict_solves(extent.modes));
  const double columns = solves / to_double(count_slices(extent.modes));  // of one basis
  const double factorisation = kFactorFlop * extent.factor_flops + kFactorEntry * entries;
  costs.analyse = (is_quadratic ? kAnalyseQuadraticRow : kAnalyseRow) * unknowns;
  costs.factor = to_double(predict_factorisations(extent.modes)) * factorisation;
  costs.solve = kSolveEntry * entries * solves;
  costs.orthogonalise = kBasisNumber * unknowns * columns * solves + kSmallNumber * columns * columns * solves;
  costs.check = kCheckNumber * shapes + kCheckPair * shapes * modes;
  if (extent.is_thin && extent.modes > 0) costs.check += factorisation + kCorrected * (costs.solve + costs.orthogonalise);
  return costs;
}

Costs calc_wall(const Costs& costs, const Extent& extent, int ranks) {
  Costs wall = costs;
  for (double Costs::*phase : {&Costs::partition, &Costs::assemble, &Costs::analyse, &Costs::factor, &Costs::solve, &Costs::orthogonalise,
                               &Costs::check, &Costs::errors, &Costs::collect})
    wall.*phase /= ranks;
  if (extent.is_read_by_all) wall.read /= ranks;
  return wall;
}

double measure_speed() {
  constexpr double kMultiplyAddsPerSecond = 4.9e9;  // there
  constexpr std::size_t kNumbers = 1024;
  constexpr int kPasses = 4000;
  std::vector<double> x(kNumbers, 1.0), y(kNumbers, 0.0);
  double best = 1e300;
  for (int attempt = 0; attempt < 8; ++attempt) {
    const std::clock_t start = std::clock();
    for (int pass = 0; pass < kPasses; ++pass) {
      const double by = 1e-9 * pass;
      for (std::size_t i = 0; i < kNumbers; ++i) y[i] += by * x[i];
      x[static_cast<std::size_t>(pass) % kNumbers] += 1e-12 * y[0];
    }
    best = std::min(best, static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
  }
  return std::clamp(kNumbers * static_cast<double>(kPasses) / std::max(best, 1e-6) / kMultiplyAddsPerSecond, 0.05, 20.0);
}

}  // namespace carillon::io

// Method:     Counts of what grows (elements, entries and operations of the factor, columns of the basis) times rates measured on one
//             machine, least squares over the runs of tests/bench/predict; another machine is scaled by one number, the time of a kernel.
//             Entries and operations of a factor that was not analysed yet by powers of the unknowns (George 1973: 4/3 and 2 for solids
//             without end; less for bodies of this size).
// Source:     none. Deviations: none.
#include "precompute/io/costs.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

namespace carillon::io {
namespace {

constexpr std::int64_t kSliceModes = 320;  // of a slice at most, see eigen/solve_modes.cpp
constexpr std::int64_t kUsualModes = 200;  // of a band that was not counted
constexpr double kUsualEntries = 270, kUsualEntryPower = 1.33;
constexpr double kUsualFlops = 2.0e10, kUsualFlopPower = 1.7;  // of 100,000 unknowns
constexpr double kDenseRows = 300;

// CPU seconds.
constexpr double kReadTet = 1.5e-6, kReadQuadraticTet = 4e-6;
constexpr double kPartTet = 2e-6, kPartQuadraticTet = 4e-6;
constexpr double kAssembleTet = 1e-6, kAssembleQuadraticTet = 6e-6;
constexpr double kAnalyseNode = 8e-6;
constexpr double kFactorFlop = 4e-11, kFactorEntry = 4e-9;
constexpr double kSolveEntry = 1.1e-10;
constexpr double kBasisNumber = 1.5e-10, kSmallNumber = 2e-9;
constexpr double kCheckNumber = 4e-8, kCheckPair = 1e-10;
constexpr double kErrorTet = 1e-8, kErrorQuadraticTet = 8e-8;
constexpr double kCollectNumber = 3e-8, kWriteNumber = 5e-9;

double to_double(std::int64_t value) { return static_cast<double>(value); }

}  // namespace

std::int64_t predict_solves(std::int64_t modes) {
  const std::int64_t slices = std::max<std::int64_t>(1, (modes + kSliceModes - 1) / kSliceModes);
  return (slices > 1 ? 27 : 21) * modes / 10 + 80 * slices;
}

std::int64_t predict_factorisations(std::int64_t modes) {
  if (modes == 0) return 3;
  return 2 + std::max<std::int64_t>(1, (modes + kSliceModes - 1) / kSliceModes);
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
  costs.read = extent.read_seconds > 0 ? extent.read_seconds : (is_quadratic ? kReadQuadraticTet : kReadTet) * tets;
  costs.partition = (is_quadratic ? kPartQuadraticTet : kPartTet) * tets;
  costs.assemble = (is_quadratic ? kAssembleQuadraticTet : kAssembleTet) * tets;
  costs.errors = (is_quadratic ? kErrorQuadraticTet : kErrorTet) * tets * modes;
  costs.collect = kCollectNumber * surface;
  costs.write = kWriteNumber * surface;
  if (unknowns <= kDenseRows) return costs;
  const double solves = to_double(predict_solves(extent.modes));
  const double slices = std::ceil(modes / to_double(kSliceModes));
  const double columns = solves / std::max(slices, 1.0);  // of one basis
  costs.analyse = kAnalyseNode * unknowns / 3;
  costs.factor = to_double(predict_factorisations(extent.modes)) * (kFactorFlop * extent.factor_flops + kFactorEntry * entries);
  costs.solve = kSolveEntry * entries * solves;
  costs.orthogonalise = kBasisNumber * unknowns * columns * solves + kSmallNumber * columns * columns * solves;
  costs.check = kCheckNumber * shapes + kCheckPair * shapes * modes;
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

double measure_speed() { return 1; }

}  // namespace carillon::io

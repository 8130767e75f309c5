// Method: counts (elements, entries and operations of the factor, columns of the basis) times calibrated rates, fitted by least squares to
// the runs of tests/bench/predict.
#include "precompute/job/cost/seconds.hpp"

#include <algorithm>

#include "precompute/job/cost/calibration.hpp"

namespace carillon::cost {
namespace {

double to_double(std::int64_t value) { return static_cast<double>(value); }

double calc_factorisation(const ProblemSize& size) {
  return kFactorFlop * size.factor_flops + kFactorEntry * to_double(size.factor_entries);
}

/// Static integrals once; per wave number: the matrix, and products with the modes that use it.
double predict_air(const ProblemSize& size) {
  if (size.air_nodes == 0) return 0.0;
  const double nodes = to_double(size.air_nodes), modes = to_double(*size.modes), waves = std::min(modes, kAirWaves);
  const double readers = modes > kAirWaves ? kAirReaders * modes : modes;
  return kAirNode * nodes + nodes * nodes * (kAirEntry * waves + kAirProduct * readers);
}

/// One factorisation; loads, solves and products of the fields.
double predict_coupling(const ProblemSize& size) {
  if (size.coupled_modes == 0) return 0.0;
  const double n = size.coupled_modes, pairs = n * (n + 1) / 2, tets = to_double(size.tets);
  const double factorisation = calc_factorisation(size) + (size.is_quadratic ? kAssembleQuadraticTet : kAssembleTet) * tets;
  const double points = size.is_quadratic ? 4 * tets : tets;
  const double fields = predict_coupling_solves(size.coupled_modes);
  return factorisation + fields * (kCouplingSolveEntry * to_double(size.factor_entries) + kCouplingPoint * points) +
         kCouplingProduct * points * pairs * fields + (size.coupled_modes > kModesOfAllPairs ? kCouplingSearch * n * n : 0.0);
}

}  // namespace

double predict_coupling_solves(int modes) {
  const double n = modes;
  return modes <= kModesOfAllPairs ? n * (n + 1) / 2 : kFieldsPerMode * n;
}

PhaseSeconds predict_seconds(const ProblemSize& known) {
  const ProblemSize size = complete(known);
  const bool is_quadratic = size.is_quadratic;
  const double tets = to_double(size.tets);
  const double unknowns = to_double(size.unknowns);
  const double modes = to_double(*size.modes);
  const double shapes = unknowns * modes;
  const double surface = 3 * to_double(size.surface_nodes) * modes;
  PhaseSeconds seconds;
  seconds.read = kStart + (size.read_seconds > 0 ? size.read_seconds : (is_quadratic ? kReadQuadraticTet : kReadTet) * tets);
  seconds.partition = kPartitionTet * tets;
  seconds.assemble = (is_quadratic ? kAssembleQuadraticTet : kAssembleTet) * tets;
  seconds.errors = (is_quadratic ? kErrorQuadraticMode : kErrorMode) * tets * modes + kErrorTet * tets;
  seconds.collect = kCollectNumber * surface;
  seconds.write = kWriteNumber * surface;
  seconds.air = predict_air(size);
  seconds.coupling = predict_coupling(size);
  if (size.unknowns <= kDenseRows) return seconds;
  const double solves = to_double(predict_solves(*size.modes));
  const double columns = solves / to_double(count_slices(*size.modes));  // of one basis
  const double factorisation = calc_factorisation(size);
  seconds.analyse = (is_quadratic ? kAnalyseQuadraticRow : kAnalyseRow) * unknowns;
  seconds.factor = to_double(predict_factorisations(*size.modes, size.counts_low_end)) * factorisation;
  seconds.solve = kSolveEntry * to_double(size.factor_entries) * solves;
  seconds.orthogonalise = kBasisNumber * unknowns * columns * solves + kSmallNumber * columns * columns * solves;
  seconds.check = kCheckNumber * shapes + kCheckPair * shapes * modes;
  if (size.is_thin && *size.modes > 0) seconds.check += factorisation + kThinCorrection * (seconds.solve + seconds.orthogonalise);
  return seconds;
}

PhaseSeconds calc_wall(const PhaseSeconds& cpu, const ProblemSize& size, int ranks) {
  PhaseSeconds wall = cpu;
  for (double PhaseSeconds::*phase : {&PhaseSeconds::partition, &PhaseSeconds::assemble, &PhaseSeconds::analyse, &PhaseSeconds::factor,
                                      &PhaseSeconds::solve, &PhaseSeconds::orthogonalise, &PhaseSeconds::check, &PhaseSeconds::errors,
                                      &PhaseSeconds::coupling, &PhaseSeconds::collect, &PhaseSeconds::air})
    wall.*phase /= ranks;
  if (size.is_read_by_all) wall.read /= ranks;
  return wall;
}

}  // namespace carillon::cost

// Method: allocations in the order of the run: mesh and matrices, their node-block copies, then the larger of a factorisation and a search
// with its basis. Several ranks: scaled from one rank by factors measured on the bodies of tests/bench/predict.
#include "precompute/job/cost/memory.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "precompute/job/cost/calibration.hpp"

namespace carillon::cost {
namespace {

constexpr double kNumber = 8, kEntry = 12;  // bytes: a double, and one with its column

/// Modes found, deflated modes, and the search basis.
double calc_search_bytes(const ProblemSize& size) {
  const std::int64_t m = *size.modes;
  // Unused columns of a slice's basis take no memory.
  const std::int64_t columns =
      m > kSliceModes ? 5 * predict_solves(m) / (4 * count_slices(m)) : 2 * m + 160 + std::min(size.rigid_modes, m / 2) + size.rigid_modes;
  return kNumber * static_cast<double>(size.unknowns) * static_cast<double>(m + columns);
}

/// One rank: matrix in single precision, twenty GMRES directions for thirty-two modes, velocities.
double calc_air_bytes(const ProblemSize& size) {
  const auto nodes = static_cast<double>(size.air_nodes), modes = static_cast<double>(*size.modes);
  return std::min(8 * nodes * nodes, kAirMatrixBytes) + nodes * (20 * 32 * 8 + 60 * modes);
}

/// All ranks: responses of all pairs at the nodes and their products, or the fields of sampled motions at the points.
double calc_coupling_bytes(const ProblemSize& size) {
  const double n = size.coupled_modes, pairs = n * (n + 1) / 2;
  if (size.coupled_modes <= kModesOfAllPairs) return kNumber * pairs * (static_cast<double>(size.unknowns) + pairs);
  const double rows = (size.is_quadratic ? 24.0 : 6.0) * static_cast<double>(size.tets);
  return kNumber * rows * kCouplingColumns * n;
}

/// By log2 of the ranks; further doublings by the step.
double find_growth(const std::array<double, 3>& growth, double step, int ranks) {
  const double doublings = std::log2(static_cast<double>(ranks));
  const std::size_t index = doublings;
  if (index + 1 >= growth.size()) return growth.back() + step * (doublings + 1 - static_cast<double>(growth.size()));
  return growth[index] + (doublings - std::floor(doublings)) * (growth[index + 1] - growth[index]);
}
double find_growth(int ranks) { return find_growth(kRankGrowth, kRankGrowthStep, ranks); }

}  // namespace

double calc_matrix_bytes(const ProblemSize& size) {
  const double neighbours = size.is_quadratic ? kQuadraticRowNeighbours : kRowNeighbours;
  return 2 * kEntry * 3 * neighbours * static_cast<double>(size.unknowns);
}

MemoryParts predict_parts(const ProblemSize& known) {
  const ProblemSize size = complete(known);
  MemoryParts parts;
  parts.program = kProgramBytes;
  parts.assembled = kProgramBytes + calc_matrix_bytes(size) +
                    (size.is_quadratic ? kQuadraticMeshBytesPerTet : kMeshBytesPerTet) * static_cast<double>(size.tets);
  parts.read_peak = parts.assembled;
  parts.copies_peak = calc_matrix_bytes(size);
  parts.copies = kCopiesShare * parts.copies_peak;
  parts.factor = kNumber * static_cast<double>(size.factor_entries);
  parts.factor_peak = kFactorPeak * parts.factor;
  return parts;
}

double calc_peak_bytes(const MemoryParts& parts, const ProblemSize& known, int ranks) {
  const ProblemSize size = complete(known);
  // Update matrices and basis do not coexist; found modes remain during the next factorisation.
  const auto unknowns = static_cast<double>(size.unknowns);
  const double found = *size.modes > kSliceModes ? kNumber * unknowns * static_cast<double>(*size.modes) : 0;
  const double sparse = std::max(
      parts.copies_peak,
      parts.copies + std::max(find_growth(kFactorGrowth, 0, ranks) * parts.factor_peak + found, parts.factor + calc_search_bytes(size)));
  const bool is_dense = size.is_dense || size.unknowns <= kDenseRows;
  const double dense = is_dense ? (kDenseCopies * ranks + kDenseWork) * kNumber * unknowns * unknowns : 0;
  const double own = std::max(parts.assembled + (is_dense ? 0 : sparse), parts.read_peak) - parts.program;
  const double modes = ranks * (parts.program + kRankBytes) + find_growth(ranks) * own + dense;
  const double coupled = size.coupled_modes == 0 ? 0
                                                 : ranks * (parts.program + kRankBytes) +
                                                       find_growth(ranks) * (parts.assembled - parts.program + parts.factor) +
                                                       kNumber * unknowns * static_cast<double>(*size.modes) + calc_coupling_bytes(size);
  return std::max({modes, coupled, ranks * (parts.program + kRankBytes + calc_air_bytes(size))});
}

double predict_bytes(const ProblemSize& known, int ranks) { return calc_peak_bytes(predict_parts(known), known, ranks); }

}  // namespace carillon::cost

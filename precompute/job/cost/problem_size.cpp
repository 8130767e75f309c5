// Method: powers of the unknowns, as for nested dissection of solids (exponents measured); slice counts as in precompute/eigen.
// Source: George, Nested dissection of a regular finite element mesh, 1973 (4/3 and 2).
#include "precompute/job/cost/problem_size.hpp"

#include <algorithm>
#include <cmath>

#include "precompute/job/cost/calibration.hpp"

namespace carillon::cost {
namespace {

std::int64_t scale(std::int64_t count, double factor) { return std::llround(static_cast<double>(count) * factor); }

}  // namespace

ProblemSize estimate_file_size(std::int64_t bytes, bool is_quadratic, int refinements) {
  ProblemSize size;
  size.is_quadratic = is_quadratic;
  size.tets = static_cast<std::int64_t>(static_cast<double>(bytes) / kFileBytesPerTet) << (3 * refinements);
  return size;
}

ProblemSize estimate_meshed_size(std::int64_t nodes, bool is_quadratic) {
  ProblemSize size;
  size.is_quadratic = is_quadratic;
  size.nodes = nodes;
  size.tets = static_cast<std::int64_t>(static_cast<double>(nodes) / (is_quadratic ? kQuadraticNodesPerTet : kLinearNodesPerTet));
  return size;
}

ProblemSize complete(ProblemSize size) {
  const double nodes_per_tet = size.is_quadratic ? kQuadraticNodesPerTet : kLinearNodesPerTet;
  if (size.nodes == 0) size.nodes = static_cast<std::int64_t>(static_cast<double>(size.tets) * nodes_per_tet);
  if (size.unknowns == 0) size.unknowns = 3 * size.nodes;
  if (size.surface_nodes == 0) size.surface_nodes = size.nodes / 2;
  const double hundreds = static_cast<double>(std::max<std::int64_t>(size.unknowns, 1)) / 1e5;  // in units of 100,000
  if (size.factor_flops == 0) size.factor_flops = kFlops * std::pow(hundreds, kFlopPower);
  if (size.factor_entries == 0) size.factor_entries = static_cast<std::int64_t>(kEntries * std::pow(hundreds, kEntryPower));
  if (!size.modes) size.modes = kDefaultModes;
  return size;
}

ProblemSize refine(const ProblemSize& known, double growth) {
  ProblemSize size = complete(known);
  size.nodes = scale(size.nodes, growth);
  size.tets = scale(size.tets, growth);
  size.unknowns = scale(size.unknowns, growth);
  size.surface_nodes = scale(size.surface_nodes, std::pow(growth, 2.0 / 3));
  size.factor_flops *= std::pow(growth, kFlopPower);
  size.factor_entries = scale(size.factor_entries, std::pow(growth, kEntryPower));
  size.read_seconds *= growth;
  return size;
}

ProblemSize make_quadratic(const ProblemSize& linear) {
  const ProblemSize known = complete(linear);
  ProblemSize size = refine(known, kQuadraticNodesPerTet * static_cast<double>(known.tets) / static_cast<double>(known.nodes));
  size.tets = known.tets;
  size.read_seconds = known.read_seconds;
  size.is_quadratic = true;
  return size;
}

std::int64_t count_slices(std::int64_t modes) { return std::max<std::int64_t>(1, (modes + kSliceModes - 1) / kSliceModes); }

std::int64_t predict_solves(std::int64_t modes) { return kSliceSolves * count_slices(modes) + 2 * modes; }

std::int64_t predict_factorisations(std::int64_t modes, bool counts_low_end) {
  return modes == 0 ? 3 : (counts_low_end ? 2 : 1) + count_slices(modes);
}

}  // namespace carillon::cost

#include "tests/hard/spectra_body.hpp"

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "precompute/la/local_columns.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/hard/figure.hpp"
#include "tests/support/ranks.hpp"
#include "tests/support/subspace.hpp"

namespace carillon::hard {
namespace {

constexpr std::int64_t kDenseIsQuick = 900;  // unknowns
constexpr double kApart = 1e-6;              // Modes farther apart than this, relative, are compared one by one.

double to_lambda(double freq_hz) { return std::pow(2 * std::numbers::pi * freq_hz, 2); }

/// All modes on every rank: rows 3 node + direction by the number of the node in the mesh.
Eigen::MatrixXd gather(const Answer& answer, std::size_t nodes) {
  const mesh::LocalMesh& local = answer.pieces.local;
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * nodes), static_cast<Eigen::Index>(answer.freq_hz.size()));
  if (all.cols() == 0) return all;
  const la::LocalColumns shapes(answer.modes.shapes);
  for (Eigen::Index j = 0; j < all.cols(); ++j)
    for (std::int32_t i = 0; i < local.free_nodes; ++i)
      for (int d = 0; d < 3; ++d) all(3 * local.node_in_mesh[i] + d, j) = shapes.column(static_cast<PetscInt>(j))[3 * i + d];
  return all;
}

/// Largest sine of an angle between the spaces of degenerate modes of both; groups by the frequencies of `alone`.
double find_largest_angle(const Answer& alone, const Answer& together, std::size_t nodes) {
  Eigen::MatrixXd a = gather(alone, nodes), b = gather(together, nodes);
  MPI_Allreduce(MPI_IN_PLACE, b.data(), static_cast<int>(b.size()), MPI_DOUBLE, MPI_SUM, PETSC_COMM_WORLD);
  // M by the nodes of the mesh.
  const mesh::LocalMesh& local = alone.pieces.local;
  const tests::SparseMatrix mass = tests::copy(alone.system.mass);
  std::vector<Eigen::Triplet<double>> entries;
  const auto find = [&](Eigen::Index row) { return static_cast<int>(3 * local.node_in_mesh[row / 3] + row % 3); };
  for (int column = 0; column < mass.outerSize(); ++column)
    for (tests::SparseMatrix::InnerIterator at(mass, column); at; ++at) entries.emplace_back(find(at.row()), find(at.col()), at.value());
  tests::SparseMatrix m(a.rows(), a.rows());
  m.setFromTriplets(entries.begin(), entries.end());
  double largest = 0;
  const std::vector<double>& f = alone.freq_hz;
  for (std::size_t first = 0, last; first < f.size(); first = last) {
    for (last = first + 1; last < f.size() && f[last] < f[last - 1] * (1 + kApart);) ++last;
    const auto x = a.middleCols(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(last - first));
    const auto y = b.middleCols(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(last - first));
    const Eigen::MatrixXd rest = y - x * (x.transpose() * (m * y));
    const Eigen::MatrixXd gram = rest.transpose() * (m * rest);
    largest = std::max(largest, std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(gram).eigenvalues().maxCoeff())));
  }
  return largest;
}

}  // namespace

material::Material make_solid(double young_modulus_pa, double poisson_ratio, double density_kg_m3) {
  return {.young_modulus_pa = young_modulus_pa, .poisson_ratio = poisson_ratio, .density_kg_m3 = density_kg_m3};
}

Body join(const Body& a, const Body& b) {
  Body both = a;
  const auto shift = static_cast<std::int32_t>(a.mesh.nodes_m.size());
  both.mesh.nodes_m.insert(both.mesh.nodes_m.end(), b.mesh.nodes_m.begin(), b.mesh.nodes_m.end());
  for (const std::int32_t node : b.mesh.tets) both.mesh.tets.push_back(node + shift);
  for (const std::int32_t region : b.mesh.regions) both.mesh.regions.push_back(region + static_cast<std::int32_t>(a.materials.size()));
  both.materials.insert(both.materials.end(), b.materials.begin(), b.materials.end());
  both.mesh.node_sets.clear();
  return both;
}

Answer solve(MPI_Comm comm, const Body& body, const eigen::Options& options) {
  Answer answer;
  answer.pieces = mesh::distribute(comm, body.mesh, {}, {.elimination_order = true});
  const mesh::LocalMesh& local = answer.pieces.local;
  fem::Materials materials;
  materials.list = body.materials;
  if (body.materials.size() > 1) materials.of_tet = local.region;
  answer.system = fem::assemble(comm, local, materials, job::Mass::consistent);
  eigen::NodeLayout layout;
  layout.nodes_m.assign(local.nodes_m.begin(), local.nodes_m.begin() + local.free_nodes);
  layout.component.assign(local.component.begin(), local.component.begin() + local.free_nodes);
  layout.component_count = answer.pieces.components;
  layout.fixed = answer.pieces.fixed_m;
  layout.elimination_position = answer.pieces.elimination_position;
  answer.modes = eigen::solve_modes({answer.system.stiffness, answer.system.mass, layout}, options);
  for (const double lambda : answer.modes.lambda) answer.freq_hz.push_back(std::sqrt(lambda) / (2 * std::numbers::pi));
  return answer;
}

error_bars::ErrorBars calc_bars(MPI_Comm comm, const Body& body, const Answer& answer, const eigen::Options& options) {
  std::vector<error_bars::Solid> solids;
  for (const material::Material& material : body.materials) solids.push_back({material.calc_elasticity_pa(), material.density_kg_m3});
  const std::vector<std::int32_t> of_tet = body.materials.size() > 1 ? answer.pieces.local.region : std::vector<std::int32_t>{};
  const bool is_cut = answer.modes.band_count > static_cast<std::int64_t>(answer.freq_hz.size());
  return error_bars::calc_error_bars(
      comm, answer.pieces.local, answer.system.stiffness, answer.system.mass, solids, of_tet, job::Mass::consistent,
      {answer.modes.lambda, answer.modes.residual, answer.modes.shapes, options.low_hz, is_cut ? answer.freq_hz.back() : options.high_hz,
       answer.modes.count_below_low - answer.modes.rigid_count - answer.modes.mechanism_count});
}

std::int64_t count_below(const fem::System& alone, double freq_hz) {
  const tests::SparseMatrix shifted = tests::copy(alone.stiffness) - to_lambda(freq_hz) * tests::copy(alone.mass);
  const Eigen::SimplicialLDLT<tests::SparseMatrix> factor(shifted);
  return (factor.vectorD().array() < 0).count();
}

double find_largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] / b[i] - 1));
  return largest;
}

Answer hold_every_way(const std::string& id, const std::string& part, const Body& body, const eigen::Options& options) {
  eigen::Options way = options;
  way.method = eigen::Method::kBlockLanczos;
  Answer together = solve(PETSC_COMM_WORLD, body, way);
  const Answer alone = tests::get_ranks() > 1 ? solve(PETSC_COMM_SELF, body, way) : Answer{};
  const Answer& reference = tests::get_ranks() > 1 ? alone : together;
  const auto& counts = together.modes.proof.counts;
  const std::int64_t counted = count_below(reference.system, counts.back().freq_hz) - count_below(reference.system, counts.front().freq_hz);
  hold(id, std::abs(static_cast<double>(counted - together.modes.band_count)), 0, part + " count");
  if (!options.max_modes)
    hold(id, std::abs(static_cast<double>(counted) - static_cast<double>(together.freq_hz.size())), 0, part + " found");
  way.method = eigen::Method::kKrylovSchur;
  hold(id, find_largest_difference(solve(PETSC_COMM_WORLD, body, way).freq_hz, together.freq_hz), 1e-9, part + " Krylov-Schur");
  if (3 * together.pieces.free_nodes <= kDenseIsQuick) {
    way.method = eigen::Method::kDense;
    hold(id, find_largest_difference(solve(PETSC_COMM_WORLD, body, way).freq_hz, together.freq_hz), 1e-9, part + " dense");
  }
  if (tests::get_ranks() > 1) {
    hold(id, find_largest_difference(together.freq_hz, alone.freq_hz), 1e-9, part + " ranks");
    if (together.freq_hz.size() == alone.freq_hz.size())
      hold(id, find_largest_angle(alone, together, body.mesh.nodes_m.size()), 1e-6, part + " subspaces");
  }
  return together;
}

void hold_bars(const std::string& id, const std::string& part, const Body& body, const Answer& answer, const eigen::Options& options,
               const std::vector<double>& true_hz) {
  const error_bars::ErrorBars bars = calc_bars(PETSC_COMM_WORLD, body, answer, options);
  double worst = answer.freq_hz.empty() ? std::numeric_limits<double>::infinity() : 0;
  for (std::size_t m = 0; m < std::min(true_hz.size(), answer.freq_hz.size()); ++m)
    worst = std::max(worst,
                     std::abs(1200 * std::log2(answer.freq_hz[m] / true_hz[m])) / (bars.algebraic_cents[m] + bars.discretisation_cents[m]));
  hold(id, worst, 1, part + " error over bar");
}

void hold_groups(const std::string& id, const std::string& part, const std::vector<double>& freq_hz, std::size_t first,
                 const std::vector<int>& sizes, double bound) {
  double widest = 0;
  for (const int size : sizes) {
    const std::size_t last = first + static_cast<std::size_t>(size) - 1;
    if (last >= freq_hz.size()) return hold(id, std::numeric_limits<double>::infinity(), bound, part + " modes are missing");
    widest = std::max(widest, freq_hz[last] / freq_hz[first] - 1);
    first = last + 1;
  }
  hold(id, widest, bound, part + " split");
}

}  // namespace carillon::hard

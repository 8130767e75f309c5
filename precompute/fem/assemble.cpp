// Method: element matrices are added into AIJ matrices whose pattern is known before: each rank lists the node pairs of its elements, sends
//   the pairs whose row another rank owns to that rank, and counts. Rigid-body data: sums of element moments about a common point.
// Source: OSG02 section 3.2; PETSc manual, "Preallocation of memory for parallel AIJ".
// Deviations: held nodes are left out (no row, no column) instead of being penalised.
#include "precompute/fem/assemble.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "precompute/fem/element.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::fem {
namespace {

using NodePair = std::uint64_t;  // row << 32 | column, so that sorting orders by row, then by column

NodePair make_pair(std::int32_t row, std::int32_t column) {
  return static_cast<std::uint64_t>(row) << 32 | static_cast<std::uint32_t>(column);
}

void sort_unique(std::vector<NodePair>& pairs) {
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
}

/// The rows of all ranks: rank r has the rows first[r] ... first[r + 1] - 1 (nodes, not degrees of freedom).
std::vector<std::int32_t> find_row_ranges(MPI_Comm comm, const LocalMesh& local) {
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  std::vector<std::int32_t> first(ranks + 1, 0);
  MPI_Allgather(&local.free_nodes, 1, MPI_INT32_T, first.data() + 1, 1, MPI_INT32_T, comm);
  std::partial_sum(first.begin(), first.end(), first.begin());
  return first;
}

/// Sends every pair to the rank that owns its row and returns what arrived, this rank's own pairs included. Collective.
std::vector<NodePair> exchange_pairs(MPI_Comm comm, const std::vector<NodePair>& sorted, const std::vector<std::int32_t>& first_row) {
  const int ranks = static_cast<int>(first_row.size()) - 1;
  std::vector<int> sent(ranks), sent_at(ranks + 1, 0), got(ranks), got_at(ranks + 1, 0);
  for (int r = 0; r < ranks; ++r) {
    const auto begin = std::lower_bound(sorted.begin(), sorted.end(), make_pair(first_row[r], 0));
    const auto end = std::lower_bound(sorted.begin(), sorted.end(), make_pair(first_row[r + 1], 0));
    sent_at[r] = static_cast<int>(begin - sorted.begin());
    sent[r] = static_cast<int>(end - begin);
  }
  MPI_Alltoall(sent.data(), 1, MPI_INT, got.data(), 1, MPI_INT, comm);
  std::partial_sum(got.begin(), got.end(), got_at.begin() + 1);
  std::vector<NodePair> arrived(got_at.back());
  MPI_Alltoallv(sorted.data(), sent.data(), sent_at.data(), MPI_UINT64_T, arrived.data(), got.data(), got_at.data(), MPI_UINT64_T, comm);
  return arrived;
}

/// Per owned free node the number of nodes it is coupled with, itself included: on this rank's columns and on others'.
struct Pattern {
  std::vector<PetscInt> diagonal;
  std::vector<PetscInt> off_diagonal;
};

Pattern find_pattern(MPI_Comm comm, const LocalMesh& local) {
  const int width = local.nodes_per_tet();
  std::vector<NodePair> pairs;
  pairs.reserve(local.tets.size() * width);
  for (std::size_t e = 0; e < local.tets.size(); e += width)
    for (int i = 0; i < width; ++i)
      for (int j = 0; j < width; ++j) {
        const std::int32_t row = local.row[local.tets[e + i]], column = local.row[local.tets[e + j]];
        if (row >= 0 && column >= 0) pairs.push_back(make_pair(row, column));
      }
  sort_unique(pairs);
  const std::vector<std::int32_t> first_row = find_row_ranges(comm, local);
  pairs = exchange_pairs(comm, pairs, first_row);
  sort_unique(pairs);
  Pattern pattern{std::vector<PetscInt>(local.free_nodes, 0), std::vector<PetscInt>(local.free_nodes, 0)};
  const std::int32_t begin = local.first_row, end = local.first_row + local.free_nodes;
  for (const NodePair pair : pairs) {
    const auto row = static_cast<std::int32_t>(pair >> 32), column = static_cast<std::int32_t>(pair & 0xffffffffU);
    ++(column >= begin && column < end ? pattern.diagonal : pattern.off_diagonal)[row - begin];
  }
  return pattern;
}

/// An empty AIJ matrix of 3 x 3 blocks with room for `per_node` entries in each row of a block for every coupled node.
petsc::MatHandle make_matrix(MPI_Comm comm, const Pattern& pattern, int per_node) {
  const PetscInt rows = petsc::to_petsc_int(3 * static_cast<std::int64_t>(pattern.diagonal.size()));
  std::vector<PetscInt> diagonal, off_diagonal;
  for (std::size_t i = 0; i < pattern.diagonal.size(); ++i) {
    diagonal.insert(diagonal.end(), 3, per_node * pattern.diagonal[i]);
    off_diagonal.insert(off_diagonal.end(), 3, per_node * pattern.off_diagonal[i]);
  }
  petsc::MatHandle matrix;
  petsc::check(MatCreate(comm, matrix.out()));
  petsc::check(MatSetSizes(matrix, rows, rows, PETSC_DETERMINE, PETSC_DETERMINE));
  petsc::check(MatSetBlockSize(matrix, 3));
  petsc::check(MatSetType(matrix, MATAIJ));
  petsc::check(MatSeqAIJSetPreallocation(matrix, 0, diagonal.data()));
  petsc::check(MatMPIAIJSetPreallocation(matrix, 0, diagonal.data(), 0, off_diagonal.data()));
  petsc::check(MatSetOption(matrix, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_TRUE));
  return matrix;
}

void finish(const petsc::MatHandle& matrix) {
  petsc::check(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  petsc::check(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  petsc::check(MatSetOption(matrix, MAT_SYMMETRIC, PETSC_TRUE));
  petsc::check(MatSetOption(matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
}

/// Adds the matrices of one element. Negative rows, which are held nodes, are skipped by PETSc.
void add_element(const ElementMatrices& element, const std::array<PetscInt, kMaxNodes>& rows, spec::Mass mass, const System& system) {
  const PetscInt n = element.nodes;
  petsc::check(MatSetValuesBlocked(system.stiffness, n, rows.data(), n, rows.data(), element.stiffness.data(), ADD_VALUES));
  for (int direction = 0; direction < 3; ++direction) {
    std::array<PetscInt, kMaxNodes> at;
    for (int i = 0; i < n; ++i) at[i] = rows[i] < 0 ? -1 : 3 * rows[i] + direction;
    if (mass == spec::Mass::consistent) {
      petsc::check(MatSetValues(system.mass, n, at.data(), n, at.data(), element.mass.data(), ADD_VALUES));
    } else {
      for (int i = 0; i < n; ++i) petsc::check(MatSetValue(system.mass, at[i], at[i], element.mass[i * n + i], ADD_VALUES));
    }
  }
}

std::vector<Vec3> find_positions(const LocalMesh& local, std::int32_t e) {
  const int width = local.nodes_per_tet();
  std::vector<Vec3> x(width);
  for (int i = 0; i < width; ++i) x[i] = local.nodes_m[local.tets[static_cast<std::size_t>(e) * width + i]];
  return x;
}

[[noreturn]] void fail_element(const LocalMesh& local, std::int32_t e) {
  const auto x = find_positions(local, e);
  // Elements and nodes are counted from 1, as the mesh check does.
  throw InputError(
      fmt::format("element {} of the mesh (first node {} at {:.6g} {:.6g} {:.6g} m) is inside out or flat: its Jacobian is not "
                  "positive everywhere{}",
                  local.tet_in_mesh[e] + 1, local.node_in_mesh[local.tets[static_cast<std::size_t>(e) * local.nodes_per_tet()]] + 1,
                  x[0][0], x[0][1], x[0][2],
                  local.order == 1 ? "; remesh there"
                                   : "; a mid-side node lies too far from the middle of its edge: straighten that edge or "
                                     "remesh there with smaller elements"));
}

}  // namespace

System assemble(MPI_Comm comm, const LocalMesh& local, const spec::Material& material, spec::Mass mass) {
  const Pattern pattern = find_pattern(comm, local);
  const Pattern ones{std::vector<PetscInt>(local.free_nodes, 1), std::vector<PetscInt>(local.free_nodes, 0)};
  System system{make_matrix(comm, pattern, 3), make_matrix(comm, mass == spec::Mass::consistent ? pattern : ones, 1)};
  petsc::run_agreed(comm, [&] {
    const int width = local.nodes_per_tet();
    ElementMatrices element;
    for (std::int32_t e = 0; e < local.tet_count(); ++e) {
      if (!calc_element(find_positions(local, e), material, mass, element)) fail_element(local, e);
      std::array<PetscInt, kMaxNodes> rows;
      for (int i = 0; i < width; ++i) rows[i] = local.row[local.tets[static_cast<std::size_t>(e) * width + i]];
      add_element(element, rows, mass, system);
    }
  });
  finish(system.stiffness);
  finish(system.mass);
  petsc::check(MatSetOption(system.mass, MAT_SPD, PETSC_TRUE));
  return system;
}

RigidBody calc_rigid_body(MPI_Comm comm, const LocalMesh& local, double density_kg_m3) {
  // Moments are taken about the centre of the nodes' box, so that a body far from the origin keeps its digits.
  Vec3 low, high, origin;
  low.fill(1e300);
  high.fill(-1e300);
  for (const Vec3& x : local.nodes_m)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], x[k]);
      high[k] = std::max(high[k], x[k]);
    }
  MPI_Allreduce(MPI_IN_PLACE, low.data(), 3, MPI_DOUBLE, MPI_MIN, comm);
  MPI_Allreduce(MPI_IN_PLACE, high.data(), 3, MPI_DOUBLE, MPI_MAX, comm);
  for (int k = 0; k < 3; ++k) origin[k] = (low[k] + high[k]) / 2;

  std::array<double, 14> sum{};  // volume, mass, first moments, second moments
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    auto x = find_positions(local, e);
    for (Vec3& at : x)
      for (int k = 0; k < 3; ++k) at[k] -= origin[k];
    const ElementMoments moments = calc_moments(x, density_kg_m3);
    sum[0] += moments.volume_m3;
    sum[1] += moments.mass_kg;
    for (int k = 0; k < 3; ++k) sum[2 + k] += moments.first_kg_m[k];
    for (int k = 0; k < 9; ++k) sum[5 + k] += moments.second_kg_m2[k];
  }
  MPI_Allreduce(MPI_IN_PLACE, sum.data(), static_cast<int>(sum.size()), MPI_DOUBLE, MPI_SUM, comm);

  RigidBody body;
  body.volume_m3 = sum[0];
  body.mass_kg = sum[1];
  std::array<double, 9> second;  // integral rho x x^T about the centre of mass
  for (int r = 0; r < 3; ++r) {
    body.centre_m[r] = origin[r] + sum[2 + r] / sum[1];
    for (int c = 0; c < 3; ++c) second[3 * r + c] = sum[5 + 3 * r + c] - sum[2 + r] * sum[2 + c] / sum[1];
  }
  const double trace = second[0] + second[4] + second[8];
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) body.inertia_kg_m2[3 * r + c] = (r == c ? trace : 0.0) - second[3 * r + c];
  return body;
}

}  // namespace carillon::fem

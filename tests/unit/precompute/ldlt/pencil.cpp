#include "tests/unit/precompute/ldlt/pencil.hpp"

#include <random>

#include "precompute/petsc/session.hpp"

namespace carillon::ldlt::test {
namespace {

void add_spring(Eigen::MatrixXd& k, int a, int b, const Eigen::Vector3d& along, double rate) {
  const Eigen::Matrix3d block = rate * along * along.transpose() / along.squaredNorm();
  k.block<3, 3>(3 * a, 3 * a) += block;
  k.block<3, 3>(3 * b, 3 * b) += block;
  k.block<3, 3>(3 * a, 3 * b) -= block;
  k.block<3, 3>(3 * b, 3 * a) -= block;
}

petsc::MatHandle make_matrix(const Eigen::MatrixXd& dense, PetscInt first, PetscInt rows, bool whole_blocks) {
  petsc::MatHandle matrix;
  const auto size = static_cast<PetscInt>(dense.rows());
  petsc::check(MatCreate(PETSC_COMM_WORLD, matrix.out()));
  petsc::check(MatSetSizes(matrix, rows, rows, size, size));
  petsc::check(MatSetType(matrix, MATAIJ));
  petsc::check(MatSetUp(matrix));
  petsc::check(MatSetOption(matrix, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  for (PetscInt i = first; i < first + rows; ++i)
    for (PetscInt j = 0; j < size; ++j) {
      const bool is_stored = whole_blocks ? !dense.block<3, 3>(i / 3 * 3, j / 3 * 3).isZero(0) : dense(i, j) != 0;
      if (is_stored) petsc::check(MatSetValue(matrix, i, j, dense(i, j), INSERT_VALUES));
    }
  petsc::check(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  petsc::check(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  return matrix;
}

}  // namespace

void distribute(Pencil& pencil, const std::vector<int>& nodes_of_rank) {
  int rank = 0;
  int ranks = 1;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  const auto nodes = static_cast<PetscInt>(pencil.dense_k.rows() / 3);
  PetscInt first = 0;
  PetscInt own = 0;
  if (nodes_of_rank.empty()) {
    first = nodes * rank / ranks;
    own = nodes * (rank + 1) / ranks - first;
  } else {
    for (int r = 0; r < rank; ++r) first += nodes_of_rank[r];
    own = nodes_of_rank[rank];
  }
  pencil.first_row = 3 * first;
  pencil.rows = 3 * own;
  pencil.k = make_matrix(pencil.dense_k, pencil.first_row, pencil.rows, true);
  pencil.m = make_matrix(pencil.dense_m, pencil.first_row, pencil.rows, false);
}

Pencil make_lattice(int nx, int ny, int nz, int copies, MassKind kind, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> rate(0.5, 2.0);
  const int count = nx * ny * nz;
  Pencil pencil;
  pencil.dense_k = Eigen::MatrixXd::Zero(3 * count * copies, 3 * count * copies);
  pencil.dense_m = pencil.dense_k;
  for (int copy = 0; copy < copies; ++copy)
    for (int a = 0; a < count; ++a) {
      const Eigen::Vector3i at(a % nx, a / nx % ny, a / nx / ny);
      for (int b = a + 1; b < count; ++b) {
        const Eigen::Vector3i step = Eigen::Vector3i(b % nx, b / nx % ny, b / nx / ny) - at;
        if (step.cwiseAbs().maxCoeff() > 1) continue;
        add_spring(pencil.dense_k, copy * count + a, copy * count + b, step.cast<double>(), rate(random));
        if (kind == MassKind::kDiagonal) continue;
        const double mass = 0.1 * rate(random);
        for (int d = 0; d < 3; ++d)
          for (const auto& [i, j, sign] : {std::tuple{a, a, 2}, {b, b, 2}, {a, b, 1}, {b, a, 1}})
            pencil.dense_m(3 * (copy * count + i) + d, 3 * (copy * count + j) + d) += sign * mass;
      }
      for (int d = 0; d < 3; ++d) pencil.dense_m(3 * (copy * count + a) + d, 3 * (copy * count + a) + d) += 0.5 * rate(random);
    }
  distribute(pencil);
  return pencil;
}

Pencil make_random(int nodes, int degree, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> value;
  std::uniform_int_distribution<int> pick(0, nodes - 1);
  Pencil pencil;
  pencil.dense_k = Eigen::MatrixXd::Zero(3 * nodes, 3 * nodes);
  pencil.dense_m = Eigen::MatrixXd::Identity(3 * nodes, 3 * nodes);
  for (int a = 0; a < nodes; ++a)
    for (int k = 0; k <= degree / 2; ++k) {
      const int b = k == 0 ? a : pick(random);
      Eigen::Matrix3d block;
      for (double& entry : block.reshaped()) entry = value(random);
      if (a == b) block = (block + block.transpose()).eval();
      pencil.dense_k.block<3, 3>(3 * a, 3 * b) = block;
      pencil.dense_k.block<3, 3>(3 * b, 3 * a) = block.transpose();
    }
  distribute(pencil);
  return pencil;
}

}  // namespace carillon::ldlt::test

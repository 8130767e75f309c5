// Rows and products of a distributed matrix of 3x3 node blocks, against PETSc.
#include "precompute/la/node_matrix.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "precompute/la/node_rows.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/instruction_sets.hpp"

namespace carillon::la {
namespace {

using petsc::check;

constexpr PetscInt kNodes = 37;

// Symmetric. Every node is linked to its neighbours and to the sixth node on both sides, so that each rank needs nodes of others. is_mass:
// one number per pair of nodes on the diagonal of its block.
petsc::MatHandle make_matrix(bool is_mass, PetscInt nodes = kNodes) {
  const comm::Communicator comm(PETSC_COMM_WORLD);
  const PetscInt own = nodes / comm.size() + (comm.rank() < nodes % comm.size() ? 1 : 0);
  petsc::MatHandle matrix;
  check(MatCreateAIJ(comm, 3 * own, 3 * own, PETSC_DECIDE, PETSC_DECIDE, 15, nullptr, 15, nullptr, matrix.out()));
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(matrix, &first, &last));
  for (PetscInt row = first; row < last; ++row) {
    for (const PetscInt step : {-6, -1, 0, 1, 6}) {
      const PetscInt other = row / 3 + step;
      if (other < 0 || other >= nodes) continue;
      for (PetscInt d = 0; d < 3; ++d) {
        const PetscInt column = 3 * other + d;
        if (is_mass && d != row % 3) continue;
        const double sum = static_cast<double>(is_mass ? row / 3 + other : row + column);
        check(MatSetValue(matrix, row, column, std::sin(1.3 * sum) + (row == column ? 9 : 0), INSERT_VALUES));
      }
    }
  }
  check(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  return matrix;
}

TEST(NodeMatrix, multiplies_as_petsc_does) {
  tests::for_each_instruction_set([&] {
    constexpr int kColumns = 19;
    for (const bool is_mass : {false, true}) {
      const petsc::MatHandle matrix = make_matrix(is_mass);
      const NodeMatrix blocks(matrix, 2.0);
      petsc::VecHandle x, y;
      check(MatCreateVecs(matrix, x.out(), y.out()));
      PetscInt first = 0, last = 0;
      check(MatGetOwnershipRange(matrix, &first, &last));
      const auto rows = static_cast<std::ptrdiff_t>(last - first);
      std::vector<double> in(rows * kColumns), out(in.size());
      for (int j = 0; j < kColumns; ++j) {
        for (std::ptrdiff_t i = 0; i < rows; ++i) in[j * rows + i] = std::sin(0.3 * static_cast<double>(first + i) + 1.1 * j);
      }
      blocks.multiply({in.data(), rows, rows, kColumns}, {out.data(), rows, rows, kColumns});
      for (int j = 0; j < kColumns; ++j) {
        PetscScalar* values = nullptr;
        check(VecGetArray(x, &values));
        std::copy_n(in.data() + j * rows, rows, values);
        check(VecRestoreArray(x, &values));
        check(MatMult(matrix, x, y));
        const PetscScalar* result = nullptr;
        check(VecGetArrayRead(y, &result));
        for (std::ptrdiff_t i = 0; i < rows; ++i) EXPECT_NEAR(out[j * rows + i], 2 * result[i], 1e-12);
        check(VecRestoreArrayRead(y, &result));
      }
    }
  });
}

// Every entry is visited once: count and sums equal those of PETSc over all ranks.
TEST(NodeRows, visits_every_entry_once) {
  for (const bool is_mass : {false, true}) {
    const petsc::MatHandle matrix = make_matrix(is_mass);
    const NodeRows rows(matrix);
    EXPECT_EQ(rows.has_blocks(), !is_mass);
    std::int64_t entries = 0;
    for (PetscInt i = 0; i < rows.rows(); ++i) {
      double sum = 0, weighted = 0;
      const auto add = [&](PetscInt column, double value) {
        ++entries;
        sum += value;
        weighted += static_cast<double>(column) * value;
      };
      rows.visit(
          i, [&](PetscInt column, double value) { add(rows.first_row() + column, value); },
          [&](PetscInt column, double value) { add(rows.ghosts()[column], value); });
      PetscInt count = 0;
      const PetscInt* columns = nullptr;
      const PetscScalar* values = nullptr;
      check(MatGetRow(matrix, rows.first_row() + i, &count, &columns, &values));
      for (PetscInt k = 0; k < count; ++k) {
        sum -= values[k];
        weighted -= columns[k] * values[k];
      }
      check(MatRestoreRow(matrix, rows.first_row() + i, &count, &columns, &values));
      EXPECT_NEAR(sum, 0, 1e-12);
      EXPECT_NEAR(weighted, 0, 1e-10);
    }
    MatInfo info;
    check(MatGetInfo(matrix, MAT_GLOBAL_SUM, &info));
    EXPECT_EQ(static_cast<double>(comm::Communicator(PETSC_COMM_WORLD).sum(entries)), info.nz_used);
  }
}

TEST(NodeRows, blocks_are_those_of_the_rows) {
  const petsc::MatHandle matrix = make_matrix(false);
  const NodeRows rows(matrix);
  for (PetscInt node = 0; node < rows.rows() / 3; ++node) {
    double by_blocks = 0, by_rows = 0;
    const auto add_block = [&](PetscInt, const double* const* parts) {
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) by_blocks += parts[r][c] * (1 + r);
    };
    rows.visit_blocks(node, add_block, add_block);
    for (int r = 0; r < 3; ++r) {
      const auto add = [&](PetscInt, double value) { by_rows += value * (1 + r); };
      rows.visit(3 * node + r, add, add);
    }
    EXPECT_NEAR(by_blocks, by_rows, 1e-12);
  }
}

}  // namespace
}  // namespace carillon::la

#include "precompute/petsc/diagonal.hpp"

#include <gtest/gtest.h>

#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/ranks.hpp"

namespace carillon::petsc {
namespace {

// Rank r has r rows, so the first has none.
TEST(ReadDiagonal, gives_every_rank_its_own_rows) {
  const int rank = tests::get_rank();
  MatHandle matrix;
  check(MatCreateAIJ(MPI_COMM_WORLD, rank, rank, PETSC_DETERMINE, PETSC_DETERMINE, 2, nullptr, 1, nullptr, matrix.out()));
  PetscInt first = 0;
  PetscInt last = 0;
  check(MatGetOwnershipRange(matrix, &first, &last));
  for (PetscInt row = first; row < last; ++row) {
    check(MatSetValue(matrix, row, row, 10.0 + row, INSERT_VALUES));
    check(MatSetValue(matrix, row, 0, row == 0 ? 10.0 : -1.0, INSERT_VALUES));
  }
  check(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  const std::vector<double> diagonal = read_diagonal(matrix);
  ASSERT_EQ(diagonal.size(), static_cast<std::size_t>(rank));
  for (PetscInt row = first; row < last; ++row) EXPECT_EQ(diagonal[row - first], 10.0 + row);
}

}  // namespace
}  // namespace carillon::petsc

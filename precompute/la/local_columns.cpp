#include "precompute/la/local_columns.hpp"

#include <algorithm>

#include "precompute/petsc/session.hpp"

namespace carillon::la {

using petsc::check;

LocalColumns::LocalColumns(Mat dense) : mat(dense) {
  PetscInt first = 0;
  PetscInt last = 0;
  check(MatGetOwnershipRange(dense, &first, &last));
  check(MatGetSize(dense, nullptr, &columns));
  check(MatDenseGetLDA(dense, &stride));
  rows = last - first;
  check(MatDenseGetArray(dense, &values));
}

LocalColumns::~LocalColumns() { (void)MatDenseRestoreArray(mat, &values); }

void permute_columns(const Columns& columns, const std::vector<std::size_t>& order) {
  std::vector<double> first(columns.rows);
  std::vector<bool> is_done(order.size(), false);
  for (std::size_t start = 0; start < order.size(); ++start) {
    if (is_done[start] || order[start] == start) continue;
    std::copy_n(columns.column(static_cast<int>(start)), columns.rows, first.data());
    std::size_t to = start;
    for (; order[to] != start; to = order[to]) {  // along the cycle
      std::copy_n(columns.column(static_cast<int>(order[to])), columns.rows, columns.column(static_cast<int>(to)));
      is_done[to] = true;
    }
    std::copy_n(first.data(), columns.rows, columns.column(static_cast<int>(to)));
    is_done[to] = true;
  }
}

}  // namespace carillon::la

#include "precompute/eigen/found_modes.hpp"

#include <algorithm>
#include <utility>

#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {

using la::LocalColumns;
using petsc::check;

petsc::MatHandle FoundModes::make_columns(PetscInt count) const {
  PetscInt rows = 0, n = 0;
  const comm::Communicator comm = petsc::get_communicator(stiffness_);
  check(MatGetLocalSize(stiffness_, &rows, nullptr));
  check(MatGetSize(stiffness_, &n, nullptr));
  petsc::MatHandle columns;
  check(MatCreateDense(comm, rows, PETSC_DECIDE, n, count, nullptr, columns.out()));
  check(MatAssemblyBegin(columns, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(columns, MAT_FINAL_ASSEMBLY));
  return columns;
}

void FoundModes::reset(Mat stiffness, PetscInt capacity, const std::vector<petsc::VecHandle>& rigid) {
  stiffness_ = stiffness;
  lambda.clear();
  capacity_ = capacity;
  columns_ = make_columns(capacity);
  rigid_count_ = static_cast<int>(rigid.size());
  rigid_ = make_columns(static_cast<PetscInt>(rigid.size()));
  const LocalColumns to(rigid_);
  for (std::size_t j = 0; j < rigid.size(); ++j) {
    const PetscScalar* values = nullptr;
    check(VecGetArrayRead(rigid[j], &values));
    std::copy_n(values, to.rows, to.column(static_cast<PetscInt>(j)));
    check(VecRestoreArrayRead(rigid[j], &values));
  }
}

void FoundModes::make_room(PetscInt count) {
  if (count <= capacity_) return;
  petsc::MatHandle larger = make_columns(count);
  {
    const LocalColumns from(columns_);
    const LocalColumns to(larger);
    for (PetscInt j = 0; j < static_cast<PetscInt>(lambda.size()); ++j) std::copy_n(from.column(j), from.rows, to.column(j));
  }
  columns_ = std::move(larger);
  capacity_ = count;
}

void FoundModes::add(double eigenvalue, const double* shape) {
  const auto count = static_cast<PetscInt>(lambda.size());
  if (count == capacity_) make_room(capacity_ + capacity_ / 8 + 8);
  const LocalColumns to(columns_);
  std::copy_n(shape, to.rows, to.column(count));
  lambda.push_back(eigenvalue);
}

LockedModes FoundModes::find_above(double low) const {
  LockedModes locked;
  const auto first = static_cast<int>(std::find_if(lambda.begin(), lambda.end(), [&](double x) { return x > low; }) - lambda.begin());
  const int count = static_cast<int>(lambda.size()) - first;
  locked.lambda.assign(rigid_count_, 0.0);
  locked.lambda.insert(locked.lambda.end(), lambda.begin() + first, lambda.end());
  if (rigid_count_ > 0) locked.sets.push_back(LocalColumns(rigid_).view());
  if (count > 0) locked.sets.push_back(LocalColumns(columns_).view().part(first, count));
  return locked;
}

petsc::MatHandle FoundModes::take(const std::vector<std::size_t>& order) {
  petsc::MatHandle result;
  if (!order.empty()) {
    if (std::ssize(order) == capacity_) {
      const LocalColumns columns(columns_);
      permute_columns(columns.view(), order);
      result = std::move(columns_);
    } else {
      result = make_columns(static_cast<PetscInt>(order.size()));
      const LocalColumns from(columns_);
      const LocalColumns to(result);
      for (std::size_t j = 0; j < order.size(); ++j)
        std::copy_n(from.column(static_cast<PetscInt>(order[j])), from.rows, to.column(static_cast<PetscInt>(j)));
    }
  }
  columns_.reset();
  lambda.clear();
  capacity_ = 0;
  return result;
}

}  // namespace carillon::eigen

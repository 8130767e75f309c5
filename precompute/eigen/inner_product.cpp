#include "precompute/eigen/inner_product.hpp"

#include <algorithm>
#include <vector>

#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {

using petsc::check;

InnerProduct::InnerProduct(const comm::Communicator& comm, Mat mass, PetscInt rows, PetscInt n, int width) : comm_(comm), width_(width) {
  check(MatCreateDense(comm, rows, PETSC_DECIDE, n, width, nullptr, w_mat_.out()));
  check(MatAssemblyBegin(w_mat_, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(w_mat_, MAT_FINAL_ASSEMBLY));
  if (mass != nullptr) {
    check(PetscObjectReference(reinterpret_cast<PetscObject>(mass)));
    mass_ = petsc::MatHandle(mass);
    check(MatMatMult(mass, w_mat_, MAT_INITIAL_MATRIX, PETSC_DEFAULT, z_mat_.out()));
  } else {
    check(MatDuplicate(w_mat_, MAT_COPY_VALUES, z_mat_.out()));
  }
  z_ = la::LocalColumns(z_mat_).view();
}

InnerProduct::~InnerProduct() {
  if (is_placed_) (void)MatDenseResetArray(w_mat_);
}

void InnerProduct::place(const Columns& memory) {
  if (is_placed_) check(MatDenseResetArray(w_mat_));
  check(MatDensePlaceArray(w_mat_, memory.values));
  is_placed_ = true;
  w_ = memory.part(0, width_);
}

void InnerProduct::multiply() {
  if (mass_.get() != nullptr) {
    la::mark_changed(w_mat_);
    Mat z = z_mat_;
    check(MatMatMult(mass_, w_mat_, MAT_REUSE_MATRIX, PETSC_DEFAULT, &z));
  } else {
    for (int j = 0; j < w_.count; ++j) std::copy_n(w_.column(j), w_.rows, z_.column(j));
  }
}

la::Matrix InnerProduct::calc_products(const Columns& a, const Columns& b, std::array<double, 2>& sums) const {
  const std::ptrdiff_t count = std::ptrdiff_t{a.count} * b.count;
  std::vector<double> message(static_cast<std::size_t>(count) + sums.size(), 0.0);
  la::multiply_transposed(a, b, message.data(), a.count);
  std::copy(sums.begin(), sums.end(), message.begin() + count);
  comm_.sum(message);
  std::copy(message.begin() + count, message.end(), sums.begin());
  return Eigen::Map<const la::Matrix>(message.data(), a.count, b.count);
}

}  // namespace carillon::eigen

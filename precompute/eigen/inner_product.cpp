#include "precompute/eigen/inner_product.hpp"

#include <algorithm>
#include <vector>

#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {

using petsc::check;

InnerProduct::InnerProduct(const comm::Communicator& comm, Mat mass, PetscInt rows, PetscInt n, int width, const double* diagonal)
    : comm_(comm), width_(width), diagonal_(diagonal) {
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

la::Matrix InnerProduct::subtract_and_calc_products(const la::Product& product, int s_stride, std::span<const Columns> c, int count,
                                                    std::array<double, 2>& sums) {
  int all = 0;
  for (const Columns& set : c) all += set.count;
  const std::ptrdiff_t size = std::ptrdiff_t{all} * count;
  std::vector<double> message(static_cast<std::size_t>(size) + sums.size(), 0.0);
  const Columns w = w_.part(0, count);
  if (diagonal_ != nullptr) {
    la::subtract_and_multiply_transposed(product, s_stride, diagonal_, w, c, message.data(), all);
  } else {
    la::subtract_product(product.a, product.s, s_stride, w);
    multiply();
    double* at = message.data();
    for (const Columns& set : c) {
      la::multiply_transposed(set, z_.part(0, count), at, all);
      at += set.count;
    }
  }
  std::copy(sums.begin(), sums.end(), message.begin() + size);
  comm_.sum(message);
  std::copy(message.begin() + size, message.end(), sums.begin());
  return Eigen::Map<const la::Matrix>(message.data(), all, count);
}

void InnerProduct::subtract_and_combine(std::span<const la::Product> products, int s_stride, const double* t, int count) {
  const Columns w = w_.part(0, count);
  if (diagonal_ != nullptr) return la::subtract_and_combine(products, s_stride, t, diagonal_, w, z_.part(0, count));
  for (const la::Product& product : products) la::subtract_product(product.a, product.s, s_stride, w);
  if (t != nullptr) la::combine_columns(w, t, count);
  multiply();
}

}  // namespace carillon::eigen

// (K - sigma M)^-1 by the supernodal L L^T of CHOLMOD, ordered by METIS: the fastest direct solver of Debian on one core.
#pragma once

#include <cholmod.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "tests/bench/precompute/system_file.hpp"

namespace bench {

class CholmodOperator {
 public:
  CholmodOperator(const Matrix& stiffness, const Matrix& mass, double sigma) : n_(stiffness.n) {
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_METIS;
    common_.postorder = 1;
    common_.print = 1;
    cholmod_sparse* shifted = make_shifted(stiffness, mass, sigma);
    factor_ = cholmod_analyze(shifted, &common_);
    demand(factor_ != nullptr, "CHOLMOD: analysis failed");
    cholmod_factorize(shifted, factor_, &common_);
    demand(common_.status == CHOLMOD_OK, "CHOLMOD: K - sigma M is not positive definite, or memory is short");
    entries_ = common_.lnz;
    cholmod_free_sparse(&shifted, &common_);
  }
  ~CholmodOperator() {
    cholmod_free_dense(&x_, &common_);
    cholmod_free_dense(&y_, &common_);
    cholmod_free_dense(&e_, &common_);
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  CholmodOperator(const CholmodOperator&) = delete;
  CholmodOperator& operator=(const CholmodOperator&) = delete;

  /// x = (K - sigma M)^-1 b; the workspace is reused.
  void solve(const double* b, double* x) {
    cholmod_dense right{};
    right.nrow = right.nzmax = right.d = n_;
    right.ncol = 1;
    right.x = const_cast<double*>(b);
    right.xtype = CHOLMOD_REAL;
    right.dtype = CHOLMOD_DOUBLE;
    demand(cholmod_solve2(CHOLMOD_A, factor_, &right, nullptr, &x_, nullptr, &y_, &e_, &common_) == 1, "CHOLMOD: solve failed");
    std::memcpy(x, x_->x, n_ * sizeof(double));
    ++solves_;
  }
  double get_entries() const { return entries_; }
  int get_solves() const { return solves_; }

 private:
  /// The lower triangle by CHOLMOD's columns is the upper one by our rows; the matrices are symmetric.
  cholmod_sparse* make_shifted(const Matrix& stiffness, const Matrix& mass, double sigma) {
    std::int64_t count = 0;
    for (std::int64_t row = 0; row < n_; ++row)
      for (std::int32_t at = stiffness.first[row]; at < stiffness.first[row + 1]; ++at) count += stiffness.column[at] >= row ? 1 : 0;
    cholmod_sparse* shifted = cholmod_allocate_sparse(n_, n_, count, 1, 1, -1, CHOLMOD_REAL, &common_);
    demand(shifted != nullptr, "CHOLMOD: out of memory");
    auto* first = static_cast<int*>(shifted->p);
    auto* index = static_cast<int*>(shifted->i);
    auto* value = static_cast<double*>(shifted->x);
    int to = 0;
    for (std::int64_t row = 0; row < n_; ++row) {
      first[row] = to;
      std::int32_t in_mass = mass.first[row];
      for (std::int32_t at = stiffness.first[row]; at < stiffness.first[row + 1]; ++at) {
        const std::int32_t column = stiffness.column[at];
        if (column < row) continue;
        while (in_mass < mass.first[row + 1] && mass.column[in_mass] < column) ++in_mass;
        const bool has_mass = in_mass < mass.first[row + 1] && mass.column[in_mass] == column;
        index[to] = column;
        value[to++] = stiffness.value[at] - (has_mass ? sigma * mass.value[in_mass] : 0.0);
      }
    }
    first[n_] = to;
    return shifted;
  }

  std::int64_t n_;
  cholmod_common common_{};
  cholmod_factor* factor_ = nullptr;
  cholmod_dense* x_ = nullptr;
  cholmod_dense* y_ = nullptr;
  cholmod_dense* e_ = nullptr;
  double entries_ = 0;
  int solves_ = 0;
};

}  // namespace bench

// Dense matrix products by BLAS.
#pragma once

#include "precompute/la/lapack.hpp"

namespace carillon::coupling {

/// A B.
inline la::Matrix multiply(const la::Matrix& a, const la::Matrix& b) {
  la::Matrix c(a.rows(), b.cols());
  if (c.size() > 0)
    la::gemm(la::Transpose::kNo, a.rows(), static_cast<int>(b.cols()), a.cols(), 1, a.data(), a.rows(), b.data(), b.rows(), 0, c.data(),
             a.rows());
  return c;
}

/// A^T B.
inline la::Matrix multiply_transposed(const la::Matrix& a, const la::Matrix& b) {
  la::Matrix c(a.cols(), b.cols());
  if (c.size() > 0)
    la::gemm(la::Transpose::kYes, a.cols(), static_cast<int>(b.cols()), a.rows(), 1, a.data(), a.rows(), b.data(), b.rows(), 0, c.data(),
             a.cols());
  return c;
}

}  // namespace carillon::coupling

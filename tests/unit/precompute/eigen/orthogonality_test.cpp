// Estimated loss of orthogonality against the true one, V^T V_j in quadruple precision.
#include "precompute/eigen/orthogonality.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "precompute/petsc/noise.hpp"

namespace carillon::eigen {
namespace {

using la::Matrix;
__extension__ typedef __float128 Quad;

constexpr int kRows = 300, kBlock = 4, kSteps = 34;

// Block Lanczos on a diagonal operator in double precision, with exactly the projections requested by the estimate.
class PlainLanczos {
 public:
  PlainLanczos() : v_(kRows, kBlock * (kSteps + 2)), t_(Matrix::Zero(v_.cols(), v_.cols())) {
    for (int i = 0; i < kRows; ++i) theta_[i] = 1 / (0.37 + 0.01 * i - 1.0004);  // shift and invert, with a close eigenvalue
    Matrix first(kRows, kBlock);
    for (int j = 0; j < kBlock; ++j)
      for (int i = 0; i < kRows; ++i) first(i, j) = petsc::make_noise(static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(j));
    (void)make_orthonormal(first);
    v_.leftCols(kBlock) = first;
  }

  /// may_skip(answer of the estimate): true to skip the projection. Returns true if it was skipped.
  template <class MaySkip>
  bool step(const MaySkip& may_skip) {
    const LanczosStep here{t_, size_, kBlock, std::max(size_ - 2 * kBlock, 0)};
    const int coupled = size_ - here.previous;
    Matrix w = theta_.asDiagonal() * v_.middleCols(size_ - kBlock, kBlock);
    Matrix local(coupled, kBlock);
    local.topRows(coupled - kBlock) = t_.block(here.previous, size_ - kBlock, coupled - kBlock, kBlock);
    Matrix alpha = v_.middleCols(size_ - kBlock, kBlock).transpose() * w;
    local.bottomRows(kBlock) = alpha;
    w -= v_.middleCols(here.previous, coupled) * local;
    const bool is_skipped = may_skip(estimate_.can_skip_reorthogonalisation(here, alpha));
    const Matrix against = is_skipped ? v_.middleCols(here.previous, coupled) : v_.leftCols(size_);
    for (int pass = 0; pass < 2; ++pass) {
      const Matrix c = against.transpose() * w;
      w -= against * c;
      alpha += c.bottomRows(kBlock);
      if (!is_skipped && pass == 0) estimate_.update_noise(here, c.data(), static_cast<int>(c.rows()));
      if (!is_skipped) estimate_.record_projection(c.colwise().norm().maxCoeff());
    }
    t_.block(size_ - kBlock, size_ - kBlock, kBlock, kBlock) = 0.5 * (alpha + alpha.transpose());
    const Matrix r = make_orthonormal(w);
    estimate_.advance(here, r, is_skipped);
    v_.middleCols(size_, kBlock) = w;
    t_.block(size_, size_ - kBlock, kBlock, kBlock) = r;
    t_.block(size_ - kBlock, size_, kBlock, kBlock) = r.transpose();
    size_ += kBlock;
    return is_skipped;
  }

  /// Largest entry of V^T V_j, V_j: last block, V: preceding blocks.
  double calc_true_loss() const {
    double largest = 0;
    for (int i = 0; i < size_ - kBlock; ++i)
      for (int j = size_ - kBlock; j < size_; ++j) {
        Quad sum = 0;
        for (int row = 0; row < kRows; ++row) sum += static_cast<Quad>(v_(row, i)) * v_(row, j);
        largest = std::max(largest, std::abs(static_cast<double>(sum)));
      }
    return largest;
  }
  double get_estimated_loss() const { return estimate_.last().topRows(size_ - kBlock).cwiseAbs().maxCoeff(); }

 private:
  // Q R by Cholesky, twice.
  static Matrix make_orthonormal(Matrix& w) {
    Matrix total = Matrix::Identity(kBlock, kBlock);
    for (int pass = 0; pass < 2; ++pass) {
      const Matrix r = Eigen::LLT<Matrix>(w.transpose() * w).matrixU();
      w = r.transpose().triangularView<Eigen::Lower>().solve(w.transpose()).transpose().eval();
      total = r * total;
    }
    return total;
  }

  la::Vector theta_ = la::Vector::Zero(kRows);
  Matrix v_;
  Matrix t_;
  int size_ = kBlock;
  OrthogonalityEstimate estimate_;
};

TEST(OrthogonalityEstimate, keeps_the_basis_semi_orthogonal_with_few_projections) {
  PlainLanczos lanczos;
  int skipped = 0;
  for (int i = 0; i < kSteps; ++i) {
    skipped += lanczos.step([](bool opinion) { return opinion; }) ? 1 : 0;
    EXPECT_LT(lanczos.calc_true_loss(), 2e-8) << "block " << i;
    EXPECT_LT(lanczos.calc_true_loss(), 10 * lanczos.get_estimated_loss()) << "block " << i;
  }
  EXPECT_GT(skipped, 8);
  EXPECT_LT(skipped, kSteps - 4) << "some projections are due";
}

// Without projections from some block on, orthogonality is lost; the estimate refuses to skip before that.
TEST(OrthogonalityEstimate, predicts_the_loss) {
  PlainLanczos lanczos;
  bool has_refused = false;
  double loss = 0;
  for (int i = 0; i < kSteps; ++i) {
    lanczos.step([&](bool opinion) {
      if (i < 6) return false;
      has_refused = has_refused || !opinion;
      return true;
    });
    loss = std::max(loss, lanczos.calc_true_loss());
    EXPECT_TRUE(has_refused || loss < 2e-8) << "block " << i << " lost " << loss;
  }
  EXPECT_GT(loss, 1e-6) << "the run must lose orthogonality";
}

TEST(OrthogonalityEstimate, forgets_all_on_reset) {
  OrthogonalityEstimate estimate;
  const Matrix t = Matrix::Identity(2 * kBlock, 2 * kBlock);
  estimate.advance({t, kBlock, kBlock, 0}, Matrix::Identity(kBlock, kBlock), false);
  EXPECT_EQ(estimate.last().rows(), 2 * kBlock);
  estimate.reset();
  EXPECT_EQ(estimate.last().size(), 0);
  EXPECT_FALSE(estimate.can_skip_reorthogonalisation({t, 2 * kBlock, kBlock, 0}, Matrix::Identity(kBlock, kBlock)));
}

}  // namespace
}  // namespace carillon::eigen

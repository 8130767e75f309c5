// LAPACK wrappers against closed forms: a chain of springs and masses with known eigenvalues.
#include "precompute/la/lapack.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace carillon::la {
namespace {

constexpr int kSize = 12;

// Both ends fixed: 4 sin^2(k pi / 2 (n + 1)).
Matrix make_chain() {
  Matrix chain = Matrix::Zero(kSize, kSize);
  for (int i = 0; i < kSize; ++i) {
    chain(i, i) = 2;
    if (i > 0) chain(i, i - 1) = chain(i - 1, i) = -1;
  }
  return chain;
}
double calc_exact(int k) { return 4 * std::pow(std::sin((k + 1) * std::numbers::pi / (2 * (kSize + 1))), 2); }

TEST(Lapack, eigenpairs_of_a_chain) {
  for (const bool by_division : {false, true}) {
    Matrix vectors = make_chain();
    Vector values;
    ASSERT_EQ(by_division ? calc_eigenpairs_by_division(vectors, values) : calc_eigenpairs(vectors, values), 0);
    for (int k = 0; k < kSize; ++k) EXPECT_NEAR(values[k], calc_exact(k), 1e-13);
    EXPECT_LT((make_chain() * vectors - vectors * values.asDiagonal()).cwiseAbs().maxCoeff(), 1e-13);
    EXPECT_LT((vectors.transpose() * vectors - Matrix::Identity(kSize, kSize)).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(Lapack, generalised_eigenpairs_of_a_chain_of_unequal_masses) {
  for (const bool by_division : {false, true}) {
    // K' = D K D and M' = D D have the eigenvalues of K.
    Vector d(kSize);
    for (int i = 0; i < kSize; ++i) d[i] = 1 + 0.5 * i;
    Matrix k = d.asDiagonal() * make_chain() * d.asDiagonal(), m = d.cwiseAbs2().asDiagonal();
    const Matrix mass = m;
    Vector values;
    ASSERT_EQ(by_division ? calc_generalised_eigenpairs_by_division(k, m, values) : calc_generalised_eigenpairs(k, m, values), 0);
    for (int i = 0; i < kSize; ++i) EXPECT_NEAR(values[i], calc_exact(i), 1e-12);
    EXPECT_LT((k.transpose() * mass * k - Matrix::Identity(kSize, kSize)).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(Lapack, an_indefinite_mass_is_named) {
  Matrix k = make_chain(), m = -Matrix::Identity(kSize, kSize);
  Vector values;
  EXPECT_GT(calc_generalised_eigenpairs(k, m, values), kSize);
}

TEST(Lapack, cholesky_and_triangular_solves) {
  const Matrix a = make_chain();
  Matrix r = a;
  ASSERT_EQ(factorise_cholesky(r), 0);
  const Matrix upper = r.triangularView<Eigen::Upper>();
  EXPECT_LT((upper.transpose() * upper - a).cwiseAbs().maxCoeff(), 1e-14);
  Matrix x = a;
  solve_upper_from_right(kSize, kSize, r.data(), kSize, x.data(), kSize);
  EXPECT_LT((x * upper - a).cwiseAbs().maxCoeff(), 1e-13);
  ASSERT_EQ(invert_upper(r), 0);
  const Matrix inverse = r.triangularView<Eigen::Upper>();
  EXPECT_LT((inverse * upper - Matrix::Identity(kSize, kSize)).cwiseAbs().maxCoeff(), 1e-13);
}

TEST(Lapack, products_with_strides_between_columns) {
  Matrix a = Matrix::Random(7, 4), b = Matrix::Random(7, 3), c = Matrix::Constant(6, 3, 9);
  gemm(Transpose::kYes, 4, 3, 7, 2.0, a.data(), 7, b.data(), 7, 1.0, c.data(), 6);
  const Matrix expected = 2 * a.transpose() * b;
  EXPECT_LT((c.topRows(4) - expected - Matrix::Constant(4, 3, 9)).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_EQ(c(4, 0), 9) << "beyond the rows of the product";
}

}  // namespace
}  // namespace carillon::la

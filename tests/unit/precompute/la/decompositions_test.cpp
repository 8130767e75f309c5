// Dense decompositions against their definitions, and a matrix of known rank and singular values.
#include "precompute/la/decompositions.hpp"

#include <gtest/gtest.h>

namespace carillon::la {
namespace {

double find_largest(const Matrix& a) { return a.cwiseAbs().maxCoeff(); }

Matrix make_tall() {
  Matrix a(5, 3);
  a << 2, -1, 0, 0, 3, 1, 1, 1, 1, 4, 0, -2, 0, 0, 5;
  return a;
}

TEST(Decompositions, thin_and_whole_qr) {
  const Matrix a = make_tall();
  for (const int columns : {0, 3, 5}) {
    const Qr qr = calc_qr(a, columns);
    EXPECT_EQ(find_largest(qr.r - Matrix(qr.r.triangularView<Eigen::Upper>())), 0);
    EXPECT_LT(find_largest(qr.r.transpose() * qr.r - a.transpose() * a), 1e-13);
    if (columns == 0) continue;
    EXPECT_LT(find_largest(qr.q.transpose() * qr.q - Matrix::Identity(columns, columns)), 1e-14);
    EXPECT_LT(find_largest(qr.q.leftCols(3) * qr.r - a), 1e-14);
  }
}

TEST(Decompositions, column_space_of_a_matrix_of_lower_rank) {
  Matrix a(5, 4);
  a << make_tall(), make_tall() * Vector::Ones(3);
  const Matrix q = calc_column_space(a, 1e-8);
  ASSERT_EQ(q.cols(), 3);
  EXPECT_LT(find_largest(q * (q.transpose() * a) - a), 1e-13);
}

TEST(Decompositions, singular_values_of_scaled_rotations) {
  const Matrix u = calc_qr(make_tall(), 3).q, v = calc_qr(make_tall().topRows(3), 3).q;
  const Vector values = Vector({{5.0, 2.0, 1e-9}});
  for (const Matrix& a : {Matrix(u * values.asDiagonal() * v.transpose()), Matrix(v * values.asDiagonal() * u.transpose())}) {
    const Svd svd = calc_svd(a);
    EXPECT_LT(find_largest(svd.values - values), 1e-14);
    ASSERT_EQ(svd.v.cols(), a.cols());
    EXPECT_LT(find_largest(svd.v.transpose() * svd.v - Matrix::Identity(a.cols(), a.cols())), 1e-14);
    EXPECT_LT(find_largest((a * svd.v).colwise().norm().head(3).transpose() - values), 1e-14);
  }
}

TEST(Decompositions, inverse) {
  const Matrix a = make_tall().topRows(3);
  EXPECT_LT(find_largest(a * calc_inverse(a) - Matrix::Identity(3, 3)), 1e-14);
}

}  // namespace
}  // namespace carillon::la

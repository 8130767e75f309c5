#include "precompute/la/decompositions.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace carillon::la {

Qr calc_qr(const Matrix& a, Eigen::Index q_columns) {
  const Eigen::HouseholderQR<Matrix> qr(a);
  Qr found{{}, qr.matrixQR().topRows(std::min(a.rows(), a.cols())).triangularView<Eigen::Upper>()};
  if (q_columns > 0) found.q = qr.householderQ() * Matrix::Identity(a.rows(), q_columns);
  return found;
}

Matrix calc_column_space(const Matrix& a, double tolerance) {
  const Eigen::ColPivHouseholderQR<Matrix> qr(a);
  Eigen::Index rank = 0;
  while (rank < std::min(a.rows(), a.cols()) && std::abs(qr.matrixR()(rank, rank)) > tolerance) ++rank;
  const Matrix q = qr.householderQ() * Matrix::Identity(a.rows(), a.rows());
  return q.leftCols(rank);
}

Svd calc_svd(const Matrix& a) {
  const Eigen::JacobiSVD<Matrix> svd(a, Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

Matrix calc_inverse(const Matrix& a) { return a.inverse(); }

}  // namespace carillon::la

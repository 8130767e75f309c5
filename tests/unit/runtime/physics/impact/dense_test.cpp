// Small dense systems against Eigen, and every set of instructions against the other.
#include "runtime/physics/impact/dense.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace carillon::impact::dense {
namespace {

/// Random columns; now and then one whose largest entry is far down, so that rows have to change places.
Eigen::MatrixXd make_matrix(int n, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd A(n, n);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) A(i, j) = normal(random) * (i < j ? 1e-3 : 1.0);
  return A;
}

struct Solved {
  std::vector<double> LU, x;
  bool is_regular = false;
};

Solved solve(const Functions& functions, const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  const auto n = static_cast<std::size_t>(b.size()), stride = n + 3;
  Solved solved{std::vector<double>(n * stride, std::nan("")), std::vector<double>(b.data(), b.data() + n)};
  for (std::size_t j = 0; j < n; ++j) std::copy_n(A.data() + j * n, n, solved.LU.data() + j * stride);
  std::vector<std::size_t> pivots(n);
  solved.is_regular = functions.factorise(solved.LU.data(), n, stride, pivots.data());
  if (solved.is_regular) functions.substitute(solved.LU.data(), n, stride, pivots.data(), solved.x.data());
  return solved;
}

TEST(Dense, SolutionOfEigen) {
  std::mt19937_64 random(5);
  for (int n = 1; n <= 40; ++n) {
    const Eigen::MatrixXd A = make_matrix(n, random);
    const Eigen::VectorXd b = Eigen::VectorXd::Random(n), x = A.partialPivLu().solve(b);
    const Solved solved = solve(get_functions(), A, b);
    ASSERT_TRUE(solved.is_regular) << n;
    const Eigen::Map<const Eigen::VectorXd> own(solved.x.data(), n);
    EXPECT_LT((own - x).norm(), 1e-13 * A.inverse().norm() * A.norm() * x.norm()) << n;
    EXPECT_LT((A * own - b).norm(), 1e-13 * A.norm() * own.norm()) << n;
  }
}

TEST(Dense, SameBitsForAllInstructionSets) {
  std::mt19937_64 random(6);
  for (int n = 1; n <= 40; ++n) {
    const Eigen::MatrixXd A = make_matrix(n, random);
    const Eigen::VectorXd b = Eigen::VectorXd::Random(n);
    const std::vector<double> plain = solve(get_functions(base::Instructions::kPlain), A, b).x;
    for (const base::Instructions set : base::list_instructions()) EXPECT_EQ(solve(get_functions(set), A, b).x, plain) << n;
  }
}

TEST(Dense, SingularMatrix) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Random(7, 7);
  EXPECT_TRUE(solve(get_functions(), Eigen::MatrixXd::Identity(7, 7), Eigen::VectorXd::Ones(7)).is_regular);
  A.row(3).setZero();
  EXPECT_FALSE(solve(get_functions(), A, Eigen::VectorXd::Ones(7)).is_regular);
}

TEST(Dense, SumOfSelectedColumns) {
  const int rows = 11;
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(rows, 9);
  const std::vector<std::size_t> which{7, 0, 3};
  const std::vector<double> x{2.0, 0.0, -1.5};
  std::vector<double> y(rows, 1.0);
  get_functions().add_columns(A.data(), static_cast<std::size_t>(rows), which.data(), x.data(), x.size(), y.data(), y.size());
  const Eigen::VectorXd expected = Eigen::VectorXd::Ones(rows) + 2.0 * A.col(7) - 1.5 * A.col(3);
  for (int i = 0; i < rows; ++i) EXPECT_NEAR(y[i], expected[i], 1e-15) << i;
}

}  // namespace
}  // namespace carillon::impact::dense

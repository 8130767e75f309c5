// Products of tall column blocks against plain loops.
#include "precompute/la/block_kernels.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/support/instruction_sets.hpp"

namespace carillon::la {
namespace {

TEST(BlockKernels, agree_with_plain_loops_at_odd_sizes) {
  tests::for_each_instruction_set([&] {
    for (const int rows : {0, 1, 7, 25, 1031, 2053}) {
      for (const int wide : {1, 5, 6, 13, 40}) {
        for (const int narrow : {1, 3, 16, 17}) {
          const std::ptrdiff_t stride = rows + 3;
          std::vector<double> a(stride * wide);
          std::vector<double> b(stride * narrow);
          for (std::size_t i = 0; i < a.size(); ++i) a[i] = std::sin(1.7 * static_cast<double>(i));
          for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::cos(0.9 * static_cast<double>(i));
          const Columns wide_block{a.data(), rows, stride, wide};
          const Columns narrow_block{b.data(), rows, stride, narrow};
          std::vector<double> gram(wide * narrow);
          multiply_transposed(wide_block, narrow_block, gram.data(), wide);
          std::vector<double> turned(gram.size());
          multiply_transposed(narrow_block, wide_block, turned.data(), narrow);
          for (int j = 0; j < narrow; ++j)
            for (int i = 0; i < wide; ++i) EXPECT_NEAR(turned[i * narrow + j], gram[j * wide + i], 1e-10);
          const std::vector<double> old = b;
          subtract_product(wide_block, gram.data(), wide, narrow_block);
          for (int j = 0; j < narrow; ++j) {
            std::vector<double> rest(rows);
            std::copy_n(old.data() + j * stride, rows, rest.data());
            for (int i = 0; i < wide; ++i) {
              double sum = 0;
              for (int r = 0; r < rows; ++r) sum += a[i * stride + r] * old[j * stride + r];
              EXPECT_NEAR(gram[j * wide + i], sum, 1e-10);
              for (int r = 0; r < rows; ++r) rest[r] -= a[i * stride + r] * sum;
            }
            for (int r = 0; r < rows; ++r) ASSERT_NEAR(b[j * stride + r], rest[r], 1e-8);
          }
          const std::vector<double> before = a;
          const int kept = std::min(wide, narrow);
          combine_columns(wide_block, gram.data(), kept);
          for (int j = 0; j < kept; ++j) {
            for (int r = 0; r < rows; ++r) {
              double sum = 0;
              for (int i = 0; i < wide; ++i) sum += before[i * stride + r] * gram[j * wide + i];
              ASSERT_NEAR(a[j * stride + r], sum, 1e-8);
            }
          }
        }
      }
    }
  });
}

/// (rows, columns) with distinct numbers.
struct Block {
  Block(int rows, int columns, double seed) : values(rows + 3, columns), rows_(rows) {
    for (Eigen::Index i = 0; i < values.size(); ++i) values.data()[i] = std::sin(seed * static_cast<double>(i + 1));
  }
  Columns view() { return {values.data(), rows_, values.rows(), static_cast<int>(values.cols())}; }
  Eigen::MatrixXd rows() const { return values.topRows(rows_); }

  Eigen::MatrixXd values;
  int rows_;
};

// Fused products against products of Eigen.
TEST(BlockKernels, agree_in_one_pass_with_the_products_one_after_the_other) {
  tests::for_each_instruction_set([&] {
    for (const int rows : {0, 1, 25, 2047, 2053, 4100}) {
      for (const int wide : {0, 1, 6, 13}) {
        for (const int narrow : {1, 3, 16, 33}) {
          Block a(rows, wide, 1.7), b(rows, narrow, 0.9), c(rows, 5, 0.3), z(rows, narrow, 0.7);
          const Eigen::MatrixXd s = 0.1 * Block(wide, narrow, 1.3).values, d = Block(rows, 1, 2.1).rows();
          const auto stride = static_cast<int>(s.rows());
          const Eigen::MatrixXd expected = b.rows() - a.rows() * s.topRows(wide);
          std::vector<Columns> sets{c.view(), a.view(), b.view()};
          const int all = 5 + wide + narrow;
          Eigen::MatrixXd products = Eigen::MatrixXd::Constant(all, narrow, 7.0);
          subtract_and_multiply_transposed({a.view(), s.data()}, stride, d.data(), b.view(), sets, products.data(), all);
          EXPECT_LT((b.rows() - expected).norm(), 1e-12 * (1 + expected.norm()));
          Eigen::MatrixXd together(rows, all);
          together << c.rows(), a.rows(), expected;
          const Eigen::MatrixXd by_eigen = together.transpose() * d.asDiagonal() * expected;
          EXPECT_LT((products - by_eigen).norm(), 1e-12 * (1 + by_eigen.norm())) << rows << " " << wide << " " << narrow;

          const Eigen::MatrixXd t = Block(narrow, narrow, 0.4).rows();
          for (const bool is_combined : {false, true}) {
            const Eigen::MatrixXd left = b.rows() - a.rows() * s.topRows(wide) - c.rows() * products.topRows(5);
            const Eigen::MatrixXd result = is_combined ? Eigen::MatrixXd(left * t) : left;
            const Eigen::MatrixXd coefficients = (Eigen::MatrixXd(5 + wide, narrow) << products.topRows(5), s.topRows(wide)).finished();
            const std::vector<Product> subtracted{{c.view(), coefficients.data()}, {a.view(), coefficients.data() + 5}};
            subtract_and_combine(subtracted, 5 + wide, is_combined ? t.data() : nullptr, d.data(), b.view(), z.view());
            EXPECT_LT((b.rows() - result).norm(), 1e-12 * (1 + result.norm()));
            EXPECT_LT((z.rows() - d.asDiagonal() * result).norm(), 1e-12 * (1 + result.norm()));
          }
        }
      }
    }
  });
}

}  // namespace
}  // namespace carillon::la

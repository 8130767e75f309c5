// Tall blocks of columns against plain loops.
#include "precompute/la/block_kernels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace carillon::la {
namespace {

TEST(BlockKernels, agree_with_plain_loops_at_odd_sizes) {
  for (const int rows : {0, 1, 7, 25, 1031, 2053}) {
    for (const int wide : {1, 5, 6, 13, 40}) {
      for (const int narrow : {1, 3, 16, 17}) {
        const std::ptrdiff_t stride = rows + 3;
        std::vector<double> a(static_cast<std::size_t>(stride * wide));
        std::vector<double> b(static_cast<std::size_t>(stride * narrow));
        for (std::size_t i = 0; i < a.size(); ++i) a[i] = std::sin(1.7 * static_cast<double>(i));
        for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::cos(0.9 * static_cast<double>(i));
        const Columns wide_block{a.data(), rows, stride, wide};
        const Columns narrow_block{b.data(), rows, stride, narrow};
        std::vector<double> gram(static_cast<std::size_t>(wide * narrow));
        multiply_transposed(wide_block, narrow_block, gram.data(), wide);
        std::vector<double> turned(gram.size());
        multiply_transposed(narrow_block, wide_block, turned.data(), narrow);
        for (int j = 0; j < narrow; ++j)
          for (int i = 0; i < wide; ++i)
            EXPECT_NEAR(turned[static_cast<std::size_t>(i * narrow + j)], gram[static_cast<std::size_t>(j * wide + i)], 1e-10);
        const std::vector<double> old = b;
        subtract_product(wide_block, gram.data(), wide, narrow_block);
        for (int j = 0; j < narrow; ++j) {
          std::vector<double> rest(static_cast<std::size_t>(rows));
          std::copy_n(old.data() + j * stride, rows, rest.data());
          for (int i = 0; i < wide; ++i) {
            double sum = 0;
            for (int r = 0; r < rows; ++r)
              sum += a[static_cast<std::size_t>(i * stride + r)] * old[static_cast<std::size_t>(j * stride + r)];
            EXPECT_NEAR(gram[static_cast<std::size_t>(j * wide + i)], sum, 1e-10);
            for (int r = 0; r < rows; ++r) rest[static_cast<std::size_t>(r)] -= a[static_cast<std::size_t>(i * stride + r)] * sum;
          }
          for (int r = 0; r < rows; ++r) ASSERT_NEAR(b[static_cast<std::size_t>(j * stride + r)], rest[static_cast<std::size_t>(r)], 1e-8);
        }
        const std::vector<double> before = a;
        const int kept = std::min(wide, narrow);
        combine_columns(wide_block, gram.data(), kept);
        for (int j = 0; j < kept; ++j) {
          for (int r = 0; r < rows; ++r) {
            double sum = 0;
            for (int i = 0; i < wide; ++i)
              sum += before[static_cast<std::size_t>(i * stride + r)] * gram[static_cast<std::size_t>(j * wide + i)];
            ASSERT_NEAR(a[static_cast<std::size_t>(j * stride + r)], sum, 1e-8);
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace carillon::la

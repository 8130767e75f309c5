// Large buffers: what is kept for later ones, and what is zero.
#include "precompute/ldlt/buffer.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <fstream>

namespace carillon::ldlt {
namespace {

constexpr std::int64_t kMillion = 1 << 20;  // numbers: 8 MB

TEST(Buffer, begins_where_vectors_and_large_pages_do) {
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(Buffer(3).data()) % 64, 0U);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(Buffer(kMillion).data()) % (2U << 20), 0U);
  EXPECT_EQ(Buffer(0).data(), nullptr);
}

TEST(Buffer, serves_smaller_ones_piece_by_piece_while_reuse_lives) {
  const BufferReuse reuse;
  Buffer large(4 * kMillion, Pages::kAtOnce);
  double* const begin = large.data();
  std::fill_n(begin, large.size(), 7.0);
  large = Buffer();
  const Buffer first(kMillion);
  const Buffer second = Buffer::make_zero(2 * kMillion);
  EXPECT_EQ(first.data(), begin);
  EXPECT_EQ(second.data(), begin + kMillion);
  EXPECT_EQ(first.data()[0], 7.0) << "not cleared";
  EXPECT_TRUE(std::all_of(second.data(), second.data() + second.size(), [](double x) { return x == 0; }));
  Buffer third(2 * kMillion);  // more than is left
  std::fill_n(third.data(), third.size(), 1.0);
  EXPECT_TRUE(third.data() + third.size() <= begin || third.data() >= begin + 4 * kMillion);
}

/// Bytes of memory that the process has mapped.
std::int64_t find_mapped() {
  std::int64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * sysconf(_SC_PAGESIZE);
}

TEST(Buffer, keeps_no_more_than_256_MB_and_gives_all_of_it_back) {
  constexpr std::int64_t kSlack = std::int64_t{8} << 20;  // of the heap
  const std::int64_t before = find_mapped();
  {
    const BufferReuse reuse;
    for (int round = 0; round < 20; ++round) {
      Buffer a(24 * kMillion + 1000 * round);
      Buffer b(24 * kMillion);
      Buffer small(kMillion / 4 + 100 * round);
      EXPECT_NEAR(static_cast<double>(find_mapped() - before), 8.0 * static_cast<double>(a.size() + b.size() + small.size()),
                  (256 << 20) + kSlack);
      a = Buffer();
      b = Buffer();
      EXPECT_LE(find_mapped() - before, (std::int64_t{256} << 20) + 8 * small.size() + kSlack) << round;
      const Buffer c = Buffer::make_zero(20 * kMillion);
      EXPECT_EQ(std::count(c.data(), c.data() + c.size(), 0.0), c.size());
      std::fill_n(c.data(), c.size(), 3.0);
    }
  }
  EXPECT_NEAR(static_cast<double>(find_mapped() - before), 0, kSlack);
}

TEST(Buffer, is_fresh_and_zero_where_nothing_is_kept) {
  {
    Buffer used(kMillion, Pages::kAtOnce);
    std::fill_n(used.data(), used.size(), 7.0);
  }
  const Buffer zero = Buffer::make_zero(kMillion);
  EXPECT_TRUE(std::all_of(zero.data(), zero.data() + zero.size(), [](double x) { return x == 0; }));
}

}  // namespace
}  // namespace carillon::ldlt

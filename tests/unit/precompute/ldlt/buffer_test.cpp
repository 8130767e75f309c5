// Large buffers: pages kept for reuse, and zero-initialisation.
#include "precompute/ldlt/buffer.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>

#include "runtime/base/host.hpp"

namespace carillon::ldlt {
namespace {

constexpr std::int64_t kMillion = 1 << 20;  // numbers: 8 MB

/// Starts without kept pages.
class Buffers : public testing::Test {
 protected:
  void SetUp() override { BufferReuse::give_back_waiting(); }
};

TEST_F(Buffers, begins_where_vectors_and_large_pages_do) {
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(Buffer(3).data()) % 64, 0U);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(Buffer(kMillion).data()) % (2U << 20), 0U);
  EXPECT_EQ(Buffer(0).data(), nullptr);
}

TEST_F(Buffers, serves_smaller_ones_piece_by_piece_while_reuse_lives) {
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
  Buffer third(2 * kMillion);  // larger than the rest, which is returned
  EXPECT_TRUE(std::all_of(third.data(), third.data() + third.size(), [](double x) { return x == 0; })) << "not fresh";
}

/// Bytes mapped by the process.
std::int64_t find_mapped() {
  std::int64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * sysconf(_SC_PAGESIZE);
}

TEST_F(Buffers, joins_pieces_returned_in_any_order) {
  const BufferReuse reuse;
  double* begin = nullptr;
  {
    const Buffer large(3 * kMillion, Pages::kAtOnce);
    begin = large.data();
  }
  for (const auto& order : {std::array{0, 1, 2}, {2, 1, 0}, {0, 2, 1}, {1, 0, 2}}) {
    std::array<Buffer, 3> pieces;
    for (int k = 0; k < 3; ++k) {
      pieces[k] = Buffer(kMillion);
      ASSERT_EQ(pieces[k].data(), begin + k * kMillion);
      pieces[k].data()[7] = k + 1;
    }
    for (const int k : order) pieces[k] = Buffer();
    const Buffer whole(3 * kMillion);
    EXPECT_EQ(whole.data(), begin);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(whole.data()[k * kMillion + 7], k + 1) << "fresh pages";
  }
}

TEST_F(Buffers, maps_no_more_than_the_peak_and_returns_it) {
  constexpr std::int64_t kSlack = std::int64_t{8} << 20;  // heap
  const std::int64_t before = find_mapped();
  {
    const BufferReuse reuse;
    std::int64_t most = 0;
    for (int round = 0; round < 20; ++round) {
      Buffer a(24 * kMillion + 1000 * round);
      Buffer b(24 * kMillion);
      Buffer small(kMillion / 4 + 100 * round);
      const std::int64_t used = 8 * (a.size() + b.size() + small.size());
      most = std::max(most, used);
      EXPECT_GE(find_mapped() - before, used);
      EXPECT_LE(find_mapped() - before, most + kSlack) << round;
      a = Buffer();
      b = Buffer();
      const Buffer c = Buffer::make_zero(40 * kMillion);  // neither of the two was sufficient
      EXPECT_EQ(std::count(c.data(), c.data() + c.size(), 0.0), c.size());
      std::fill_n(c.data(), c.size(), 3.0);
      EXPECT_LE(find_mapped() - before, most + kSlack) << round;
    }
  }
  BufferReuse::give_back_waiting();
  EXPECT_NEAR(static_cast<double>(find_mapped() - before), 0, kSlack);
}

TEST_F(Buffers, keeps_pages_for_the_next_reuse_until_returned) {
  double* begin = nullptr;
  {
    const BufferReuse reuse;
    Buffer first(4 * kMillion, Pages::kAtOnce);
    begin = first.data();
    begin[5] = 7.0;
  }
  const std::int64_t waiting = find_mapped();
  {
    const Buffer early(kMillion);
    EXPECT_EQ(early.data(), begin) << "before the next reuse begins";
    EXPECT_EQ(early.data()[5], 7.0) << "fresh pages";
  }
  EXPECT_LE(find_mapped(), waiting - 8 * kMillion) << "pages freed outside of a reuse are not kept";
  BufferReuse::give_back_waiting();
  EXPECT_LE(find_mapped(), waiting - 8 * 4 * kMillion);
}

TEST_F(Buffers, lends_its_tail_and_gets_it_back) {
  constexpr std::int64_t kSlack = std::int64_t{8} << 20;
  const std::int64_t before = find_mapped();
  {
    const Buffer room(24 * kMillion, Pages::kAtOnce);
    std::fill_n(room.data(), room.size(), 7.0);
    const std::int64_t resident = base::find_memory().resident;
    for (int round = 0; round < 3; ++round) {
      BufferReuse::give_back_waiting();
      room.populate();
      const BufferReuse reuse;
      room.lend_tail(8 * kMillion);
      const Buffer first(6 * kMillion);
      EXPECT_EQ(first.data(), room.data() + 8 * kMillion);
      std::fill_n(first.data(), first.size(), 3.0);
      const Buffer second(12 * kMillion, Pages::kAtOnce);  // larger than the kept pages, which are returned
      EXPECT_TRUE(second.data() + second.size() <= room.data() || second.data() >= room.data() + room.size());
      EXPECT_LE(base::find_memory().resident, resident + 8 * 2 * kMillion + kSlack) << "6 + 12 are in use where 16 were lent";
    }
    BufferReuse::give_back_waiting();
    EXPECT_LE(base::find_memory().resident, resident + kSlack) << "more than the buffer itself";
    room.populate();
    EXPECT_GE(base::find_memory().resident, resident - kSlack) << "the tail was not returned";
    room.give_back_tail(8 * kMillion);
    EXPECT_LE(base::find_memory().resident, resident - 8 * 16 * kMillion + kSlack);
    room.populate();
    EXPECT_GE(base::find_memory().resident, resident - kSlack);
    std::fill_n(room.data() + 8 * kMillion, 16 * kMillion, 5.0);
    EXPECT_EQ(std::count(room.data(), room.data() + 8 * kMillion, 7.0), 8 * kMillion) << "pages that are not lent changed";
    EXPECT_EQ(std::count(room.data() + 8 * kMillion, room.data() + room.size(), 5.0), 16 * kMillion);
  }
  EXPECT_NEAR(static_cast<double>(find_mapped() - before), 0, kSlack) << "memory remains after the buffer";
}

TEST_F(Buffers, is_intact_after_lending_all_to_one_buffer) {
  constexpr std::int64_t kKept = 8 * kMillion;
  const Buffer room(24 * kMillion, Pages::kAtOnce);
  {
    const BufferReuse reuse;
    room.lend_tail(kKept);
    const Buffer other(16 * kMillion);  // exactly the lent pages
    ASSERT_EQ(other.data(), room.data() + kKept);
  }
  room.populate();
  std::fill_n(room.data(), room.size(), 5.0);
  EXPECT_EQ(std::count(room.data(), room.data() + room.size(), 5.0), room.size());
}

TEST_F(Buffers, lends_nothing_of_a_small_one) {
  const BufferReuse reuse;
  const Buffer room(1000);
  room.lend_tail(10);
  room.populate();
  const Buffer other(kMillion, Pages::kAtOnce);
  EXPECT_TRUE(other.data() + other.size() <= room.data() || other.data() >= room.data() + room.size());
}

TEST_F(Buffers, is_fresh_and_zero_where_nothing_is_kept) {
  {
    Buffer used(kMillion, Pages::kAtOnce);
    std::fill_n(used.data(), used.size(), 7.0);
  }
  const Buffer zero = Buffer::make_zero(kMillion);
  EXPECT_TRUE(std::all_of(zero.data(), zero.data() + zero.size(), [](double x) { return x == 0; }));
}

}  // namespace
}  // namespace carillon::ldlt

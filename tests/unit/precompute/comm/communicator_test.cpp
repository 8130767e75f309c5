// Agreement, reductions, broadcast and gathering. The expected values follow from the rule by which each rank makes its part.
#include "precompute/comm/communicator.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <new>
#include <stdexcept>

#include "precompute/comm/index_partition.hpp"
#include "runtime/base/failure.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/comm/world.hpp"

namespace carillon::comm {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using tests::catch_message;

TEST(Communicator, is_the_communicator_of_mpi_with_rank_and_size) {
  int rank = -1, size = -1;
  MPI_Comm_rank(world(), &rank);
  MPI_Comm_size(world(), &size);
  EXPECT_EQ(world().rank(), rank);
  EXPECT_EQ(world().size(), size);
  EXPECT_EQ(world().is_root(), rank == 0);
}

TEST(All, is_false_everywhere_when_one_rank_fails) {
  EXPECT_TRUE(world().all(true));
  EXPECT_FALSE(world().all(!is_last()));
}

TEST(Agree, throws_the_same_text_on_every_rank) {
  EXPECT_EQ(catch_message<InputError>([] { world().agree(is_last() ? std::string("line 3 is bad") : std::string()); }), "line 3 is bad");
  EXPECT_NO_THROW(world().agree(std::string()));
}

TEST(Agree, takes_the_error_of_the_lowest_failing_rank) {
  EXPECT_EQ(catch_message<InputError>([] { world().agree("rank " + std::to_string(world().rank())); }), "rank 0");
}

TEST(Agree, keeps_the_kind_of_the_error) {
  const auto fail = [](auto error) {
    return [error] {
      if (is_last()) throw error;
    };
  };
  EXPECT_EQ(catch_message<InputError>([&] { world().agree(fail(InputError("bad key"))); }), "bad key");
  EXPECT_EQ(catch_message<SolveError>([&] { world().agree(fail(SolveError("lost modes"))); }), "lost modes");
  EXPECT_EQ(catch_message<SystemError>([&] { world().agree(fail(SystemError("disk full"))); }), "disk full");
  EXPECT_EQ(catch_message<SystemError>([&] { world().agree(fail(std::runtime_error("a defect"))); }), "a defect");
  EXPECT_EQ(catch_message<DiskFullError>([&] { world().agree(fail(DiskFullError("no room"))); }), "no room");
  try {
    world().agree(fail(MemoryError("needs 3 GB", 3e9)));
    ADD_FAILURE() << "no exception";
  } catch (const MemoryError& error) {
    EXPECT_STREQ(error.what(), "needs 3 GB");
    EXPECT_EQ(error.get_need_bytes(), 3e9);
  }
  try {
    world().agree(fail(PlacedError("job.json:3", "bad key")));
    ADD_FAILURE() << "no exception";
  } catch (const PlacedError& error) {
    EXPECT_STREQ(error.what(), "job.json:3: bad key");
    EXPECT_EQ(error.get_place(), "job.json:3");
  }
  try {
    world().agree(fail(CountRefusal("too few nodes", 7000)));
    ADD_FAILURE() << "no exception";
  } catch (const CountRefusal& error) {
    EXPECT_STREQ(error.what(), "too few nodes");
    EXPECT_EQ(error.get_possible_nodes(), 7000);
  }
  EXPECT_THAT(catch_message<SystemError>([&] { world().agree(fail(std::bad_alloc())); }), HasSubstr("Out of memory"));
  EXPECT_NO_THROW(world().agree([] {}));
}

TEST(Agree, returns_what_each_rank_made) {
  struct MoveOnly {
    explicit MoveOnly(int v) : value(v) {}
    MoveOnly(MoveOnly&&) = default;
    int value;
  };
  EXPECT_EQ(world().agree([] { return MoveOnly(7 + world().rank()); }).value, 7 + world().rank());
}

TEST(Reductions, of_one_value_and_of_each_entry) {
  const int n = world().size();
  EXPECT_EQ(world().sum(world().rank() + 1), n * (n + 1) / 2);
  EXPECT_EQ(world().min(-1.5 * world().rank()), -1.5 * (n - 1));
  EXPECT_EQ(world().max(std::int64_t{world().rank()} << 40), std::int64_t{n - 1} << 40);
  std::vector<double> values{1.0 * world().rank(), 1.0};
  world().sum(values);
  EXPECT_THAT(values, ElementsAre(n * (n - 1) / 2, n));
}

TEST(Broadcast, brings_rank_0s_value_to_every_rank) {
  EXPECT_EQ(world().broadcast(world().rank() + 3.5), 3.5);
  EXPECT_EQ(world().broadcast(std::string(world().is_root() ? "a name" : "")), "a name");
  EXPECT_THAT(world().broadcast(world().is_root() ? std::vector<int>{4, 5} : std::vector<int>{9, 9, 9}), ElementsAre(4, 5));
  EXPECT_TRUE(world().broadcast(std::vector<int>(world().rank())).empty());
}

TEST(Broadcast, keeps_texts_with_any_byte_apart) {
  const std::vector<std::string> texts{"", std::string("a\0b", 3), "x y", ""};
  EXPECT_EQ(world().broadcast(world().is_root() ? texts : std::vector<std::string>{"other"}), texts);
}

TEST(Broadcast, runs_its_work_on_rank_0_alone_and_throws_its_error_on_all) {
  int runs = 0;
  const auto text = world().broadcast([&] {
    ++runs;
    return std::string("read once");
  });
  EXPECT_EQ(text, "read once");
  EXPECT_EQ(world().sum(runs), 1);
  EXPECT_EQ(catch_message<InputError>([] { world().broadcast([]() -> std::string { throw InputError("no such file"); }); }),
            "no such file");
}

TEST(AllGather, keeps_the_order_of_the_ranks_and_takes_empty_ranks) {
  std::vector<int> expected;
  for (int r = 0; r < world().size(); ++r) expected.insert(expected.end(), static_cast<std::size_t>(r), 10 * r);
  const std::vector<int> own(world().rank(), 10 * world().rank());  // none on rank 0
  EXPECT_EQ(world().all_gather(own), expected);
  EXPECT_EQ(world().all_gather([&] { return own; }), expected);
  EXPECT_TRUE(world().all_gather(std::vector<double>()).empty());
}

TEST(AllGather, throws_the_error_of_one_rank_on_every_rank) {
  EXPECT_EQ(catch_message<InputError>([] {
              world().all_gather([] {
                if (is_last()) throw InputError("bad element");
                return std::vector<int>{1};
              });
            }),
            "bad element");
}

TEST(AllGather, refuses_more_bytes_than_mpi_can_count) {
  EXPECT_THAT(catch_message<SystemError>([] { world().plan_gathering(is_last() ? std::size_t{1} << 31 : 0); }),
              HasSubstr("2147483648 bytes"));
  const std::size_t share =
      (std::size_t{1} << 31) / static_cast<std::size_t>(world().size());  // within the count of one rank, except for a single rank
  EXPECT_THAT(catch_message<SystemError>([&] { world().plan_gathering(share + 1); }), HasSubstr("too many to gather on every rank"));
}

TEST(IndexPartition, of_equal_runs_covers_every_number_once) {
  for (const std::int64_t total : {0, 1, 7, 12}) {
    const auto partition = IndexPartition::make_even(world(), total);
    EXPECT_EQ(partition.total(), total);
    EXPECT_EQ(world().sum(partition.own_count()), total);
    EXPECT_LE(world().max(partition.own_count()) - world().min(partition.own_count()), 1);
    for (std::int64_t i = 0; i < total; ++i) {
      EXPECT_EQ(world().sum(std::int32_t{partition.is_own(i)}), 1);
      EXPECT_EQ(partition.is_own(i), partition.find_owner(i) == world().rank());
    }
  }
}

TEST(IndexPartition, of_given_lengths_skips_ranks_without_numbers) {
  const bool is_empty = world().rank() % 2 == 1;
  const IndexPartition partition(world(), is_empty ? 0 : 5);
  EXPECT_EQ(partition.total(), 5 * ((world().size() + 1) / 2));
  for (std::int64_t i = 0; i < partition.total(); ++i) EXPECT_EQ(partition.find_owner(i), 2 * (i / 5));
  if (!is_empty) {
    EXPECT_EQ(partition.to_local(partition.own_begin() + 3), 3u);
  }
}

}  // namespace
}  // namespace carillon::comm

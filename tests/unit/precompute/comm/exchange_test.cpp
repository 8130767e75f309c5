// Items between ranks: each arrives once, at the right rank, in order, also in messages of a few bytes (the blocks used beyond the counts
// of MPI) and with ranks that send nothing. The expected values follow from the rule by which the test makes them.
#include "precompute/comm/exchange.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "precompute/comm/index_partition.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/comm/world.hpp"

namespace carillon::comm {
namespace {

using testing::HasSubstr;
using tests::catch_message;

struct Item {
  std::int32_t from = 0, to = 0, place = 0;
  bool operator==(const Item&) const = default;
};

int find_length(int from, int to) { return 3 * from + 5 * to; }  // none from rank 0 to itself

ByRank<Item> make_items() {
  ByRank<Item> sent{{}, {0}};
  for (int to = 0; to < world().size(); ++to) {
    for (int i = 0; i < find_length(world().rank(), to); ++i) sent.items.push_back({world().rank(), to, i});
    sent.begin.push_back(static_cast<std::int64_t>(sent.items.size()));
  }
  return sent;
}

void expect_all_arrived(const ByRank<Item>& received) {
  ASSERT_EQ(received.rank_count(), world().size());
  for (int from = 0; from < world().size(); ++from) {
    const auto items = received.of(from);
    ASSERT_EQ(items.size(), static_cast<std::size_t>(find_length(from, world().rank())));
    for (int i = 0; i < find_length(from, world().rank()); ++i) EXPECT_EQ(items[i], (Item{from, world().rank(), i}));
  }
}

TEST(AllToAll, brings_every_item_once_and_in_order) {
  expect_all_arrived(all_to_all(world(), make_items()));
  expect_all_arrived(all_to_all(world(), [] { return make_items(); }));
}

TEST(AllToAll, sorts_items_by_receiver) {
  std::vector<Item> items = make_items().items;
  std::stable_sort(items.begin(), items.end(), [](const Item& a, const Item& b) { return a.place < b.place; });  // receivers mixed
  const auto find_receiver = [](const Item& item) { return item.to; };
  expect_all_arrived(all_to_all(world(), items, find_receiver));
  expect_all_arrived(all_to_all(
      world(), [&] { return items; }, find_receiver));
}

TEST(AllToAll, takes_ranks_that_send_or_get_nothing) {
  const std::vector<int> items(is_last() ? 4 : 0, world().rank());
  const auto received = all_to_all(world(), items, [](int) { return 0; });
  EXPECT_EQ(received.items, world().is_root() ? std::vector<int>(4, world().size() - 1) : std::vector<int>());
  EXPECT_TRUE(all_to_all(world(), std::vector<int>(), [](int) { return 0; }).items.empty());
}

TEST(AllToAll, throws_the_error_of_one_rank_on_every_rank) {
  EXPECT_EQ(catch_message<InputError>([] {
              all_to_all(
                  world(),
                  []() -> std::vector<int> {
                    if (is_last()) throw InputError("bad face");
                    return {1};
                  },
                  [](int) { return 0; });
            }),
            "bad face");
  EXPECT_EQ(catch_message<SolveError>([] {
              all_to_all(world(), std::vector<int>{1}, [](int) -> int {
                if (is_last()) throw SolveError("no receiver");
                return 0;
              });
            }),
            "no receiver");
}

class ExchangeInBlocks : public testing::TestWithParam<std::size_t> {};

TEST_P(ExchangeInBlocks, repeats_forward_and_backward) {
  const auto sent = make_items();
  Exchange exchange(world(), sent.begin, GetParam());
  exchange.reserve(2 * sizeof(Item));
  for (int repeat = 0; repeat < 2; ++repeat) {
    ByRank<Item> received{std::vector<Item>(exchange.received_count()), exchange.received_begin()};
    exchange.forward(sent.items.data(), received.items.data());
    expect_all_arrived(received);
    std::vector<Item> returned(sent.items.size());
    exchange.backward(received.items.data(), returned.data());
    EXPECT_EQ(returned, sent.items);
  }
  std::vector<double> wide, arrived(2 * exchange.received_count());
  for (const Item& item : sent.items) wide.insert(wide.end(), {1.0 * item.from, 1.0 * item.place});
  exchange.forward(wide.data(), arrived.data(), 2);
  for (int from = 0, k = 0; from < world().size(); ++from)
    for (int i = 0; i < find_length(from, world().rank()); ++i, k += 2) {
      EXPECT_EQ(arrived[k], from);
      EXPECT_EQ(arrived[k + 1], i);
    }
}

INSTANTIATE_TEST_SUITE_P(Blocks, ExchangeInBlocks, testing::Values(1, 7, 24, kBlockBytes));

TEST(Gather, brings_all_items_to_rank_0_in_order) {
  const std::vector<int> own(world().rank(), world().rank());
  std::vector<int> expected;
  for (int r = 0; world().is_root() && r < world().size(); ++r) expected.insert(expected.end(), static_cast<std::size_t>(r), r);
  EXPECT_EQ(gather(world(), own), expected);
  EXPECT_EQ(gather(world(), [&] { return own; }), expected);
}

TEST(QueryOwners, answers_every_question_in_order) {
  const auto owners = IndexPartition::make_even(world(), 23);
  std::vector<std::int32_t> questions;
  for (int i = 0; i < (is_last() ? 0 : 40); ++i)
    questions.push_back((7 * i + world().rank()) % 23);  // with repetitions; none on the last rank
  const auto find_owner = [&](std::int32_t number) { return owners.find_owner(number); };
  std::vector<double> squares, ranks;
  for (const std::int32_t number : questions) squares.push_back(number * number);
  EXPECT_EQ(query_owners<double>(world(), questions, find_owner,
                                 [&](std::int32_t number) {
                                   EXPECT_TRUE(owners.is_own(number));
                                   return 1.0 * number * number;
                                 }),
            squares);
  const auto order = query_owners<std::int32_t>(world(), questions, find_owner, [&](const ByRank<std::int32_t>& asked) {
    std::vector<std::int32_t> askers;
    for (int r = 0; r < world().size(); ++r) askers.insert(askers.end(), asked.of(r).size(), r);
    return askers;
  });
  EXPECT_EQ(order, std::vector<std::int32_t>(questions.size(), world().rank()));
}

TEST(QueryOwners, throws_the_error_of_the_answering_rank_on_every_rank) {
  EXPECT_EQ(catch_message<InputError>([] {
              query_owners<int>(
                  world(), std::vector<int>{1}, [](int) { return world().size() - 1; },
                  [](int) -> int { throw InputError("element 7 is given twice"); });
            }),
            "element 7 is given twice");
}

TEST(ReportToOwners, brings_each_value_to_the_owner_of_its_number) {
  const IndexPartition owners(world(), world().rank() == 0 ? 0 : 3);  // the first owns none
  const auto values = report_to_owners<double>(
      world(),
      [&] {
        std::vector<Reported<double>> list;  // even numbers, distributed over the ranks in turn, the last first
        for (std::int32_t number = static_cast<std::int32_t>(owners.total()) - 1; number >= 0; --number)
          if (number % 2 == 0 && number / 2 % world().size() == world().rank()) list.push_back({number, 0.5 * number});
        return list;
      },
      owners, -1);
  ASSERT_EQ(static_cast<std::int64_t>(values.size()), owners.own_count());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::int64_t number = owners.own_begin() + static_cast<std::int64_t>(i);
    EXPECT_EQ(values[i], number % 2 == 0 ? 0.5 * static_cast<double>(number) : -1) << number;
  }
}

TEST(FindOwners, finds_owners_of_unordered_numbers) {
  std::vector<std::int32_t> owned, wanted, expected;
  const auto owner_of = [](std::int32_t number) { return (number * 5 + number / 7) % world().size(); };
  for (std::int32_t number = 0; number < 60; number += 2) {
    if (owner_of(number) == world().rank()) owned.push_back(number);
    if (number % 3 == world().rank() % 3) wanted.push_back(number);
  }
  for (const std::int32_t number : wanted) expected.push_back(owner_of(number));
  EXPECT_EQ(find_owners(world(), owned, wanted), expected);
}

std::vector<std::byte> serialise(const std::vector<int>& values) {
  std::vector<std::byte> bytes(values.size() * sizeof(int));
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}
std::vector<int> deserialise(const std::vector<std::byte>& bytes) {
  std::vector<int> values(bytes.size() / sizeof(int));
  if (!bytes.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

TEST(ScatterInTurn, gives_every_rank_its_result) {
  int made = 0;
  const auto own = scatter_in_turn(
      world(),
      [&](int rank) {
        ++made;
        return std::vector<int>(rank, 10 * rank);  // empty for rank 0
      },
      serialise, deserialise);
  EXPECT_EQ(own, std::vector<int>(world().rank(), 10 * world().rank()));
  EXPECT_EQ(made, world().is_root() ? world().size() : 0);
}

TEST(ScatterInTurn, throws_on_every_rank_when_either_side_fails) {
  const auto make = [](int rank) {
    if (rank == (world().size() > 1 ? 1 : 0)) throw InputError("no elements");
    return std::vector<int>{rank};
  };
  EXPECT_EQ(catch_message<InputError>([&] { scatter_in_turn(world(), make, serialise, deserialise); }), "no elements");
  if (world().size() == 1) return;
  const auto refuse = [](const std::vector<std::byte>&) -> std::vector<int> { throw std::bad_alloc(); };
  EXPECT_THAT(catch_message<SystemError>([&] {
                scatter_in_turn(
                    world(), [](int rank) { return std::vector<int>{rank}; }, serialise, refuse);
              }),
              HasSubstr("Out of memory"));
}

}  // namespace
}  // namespace carillon::comm

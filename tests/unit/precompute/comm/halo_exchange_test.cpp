// Values of shared numbers: copied from their owner and summed there, also in messages of a few bytes. The expected values follow from the
// rule by which the test fills them.
#include "precompute/comm/halo_exchange.hpp"

#include <gtest/gtest.h>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/comm/world.hpp"

namespace carillon::comm {
namespace {

constexpr std::int32_t kOwned = 9;
constexpr std::size_t kWidth = 3;

/// All numbers of all ranks, own ones first; `place` in reverse order.
struct AllShared {
  std::vector<std::int32_t> number, place;
  Halo halo;

  AllShared() {
    const int ranks = world().size();
    for (int r = 0; r < ranks; ++r)
      for (std::int32_t i = 0; i < kOwned; ++i) number.push_back(((world().rank() + r) % ranks) * kOwned + i);
    for (std::size_t i = 0; i < number.size(); ++i) place.push_back(static_cast<std::int32_t>(number.size() - 1 - i));
    for (std::size_t i = kOwned; i < number.size(); ++i) {
      halo.number.push_back(number[i]);
      halo.owner.push_back(number[i] / kOwned);
      halo.place.push_back(place[i]);
    }
  }
  std::int32_t find_own_place(std::int32_t own) const { return place[own % kOwned]; }
};

class HaloInBlocks : public testing::TestWithParam<std::size_t> {};

TEST_P(HaloInBlocks, copies_and_sums_shared_values) {
  const AllShared shared;
  HaloExchange exchange(
      world(), shared.halo, [&](std::int32_t own) { return shared.find_own_place(own); }, GetParam());
  EXPECT_EQ(exchange.has_neighbours(), world().size() > 1);
  exchange.reserve(kWidth * sizeof(double));

  std::vector<double> values(kWidth * shared.place.size(), -1.0);
  const auto value_of = [&](std::size_t i, std::size_t d) -> double& {
    return values[kWidth * static_cast<std::size_t>(shared.place[i]) + d];
  };
  for (std::size_t n = 0; n < kOwned; ++n)
    for (std::size_t d = 0; d < kWidth; ++d) value_of(n, d) = 10.0 * shared.number[n] + static_cast<double>(d);
  exchange.copy_to_halo(values.data(), kWidth);
  for (std::size_t n = 0; n < shared.number.size(); ++n)
    for (std::size_t d = 0; d < kWidth; ++d) EXPECT_EQ(value_of(n, d), 10.0 * shared.number[n] + static_cast<double>(d));

  for (double& value : values) value = 1.0 + world().rank();
  exchange.sum(values.data(), kWidth);
  for (const double value : values) EXPECT_EQ(value, world().size() * (world().size() + 1) / 2.0);

  std::vector<float> narrow(shared.place.size(), 1.0f);
  exchange.sum_to_owner(narrow.data(), 1);
  for (std::size_t n = 0; n < narrow.size(); ++n)
    EXPECT_EQ(narrow[shared.place[n]], n < kOwned ? static_cast<float>(world().size()) : 1.0f);
}

INSTANTIATE_TEST_SUITE_P(Blocks, HaloInBlocks, testing::Values(1, 7, 24, kBlockBytes));

// Contiguous rows, as in matrices: rank r owns r rows, and every rank keeps a copy of each other row behind its own.
TEST(Halo, of_runs_is_stored_behind_the_own_values_during_other_work) {
  const IndexPartition owners(world(), world().rank());
  std::vector<std::int32_t> numbers, places;
  for (std::int32_t row = 0; row < owners.total(); ++row)
    if (!owners.is_own(row)) {
      numbers.push_back(row);
      places.push_back(static_cast<std::int32_t>(owners.own_count()) + static_cast<std::int32_t>(places.size()));
    }
  HaloExchange exchange(world(), owners, numbers, places);
  std::vector<double> values(owners.total(), -1.0);
  for (std::int64_t i = 0; i < owners.own_count(); ++i) values[i] = 100.0 * static_cast<double>(owners.own_begin() + i);
  exchange.begin_copy_to_halo(values.data(), 1);
  exchange.end_copy_to_halo(values.data(), 1);
  for (std::size_t i = 0; i < numbers.size(); ++i) EXPECT_EQ(values[places[i]], 100.0 * numbers[i]);
}

TEST(Halo, without_neighbours_does_nothing) {
  HaloExchange exchange(world(), Halo{}, [](std::int32_t) { return 0; });
  EXPECT_FALSE(exchange.has_neighbours());
  double value = 7.0;
  exchange.sum(&value, 1);
  EXPECT_EQ(value, 7.0);
}

TEST(Halo, throws_on_every_rank_when_an_owner_has_no_such_number) {
  if (world().size() == 1) return;
  const AllShared shared;
  EXPECT_EQ(tests::catch_message<SystemError>(
                [&] { HaloExchange(world(), shared.halo, [](std::int32_t) -> std::int32_t { throw SystemError("no such number"); }); }),
            "no such number");
}

}  // namespace
}  // namespace carillon::comm

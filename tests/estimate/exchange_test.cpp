// Lists between ranks and values of shared nodes, in messages of a few bytes: what longer messages than MPI can count take. The oracle is
// the rule by which the test fills them.
#include "precompute/estimate/exchange.hpp"

#include <gtest/gtest.h>

#include "tests/support/ranks.hpp"

namespace carillon::estimate {
namespace {

using tests::get_rank;
using tests::get_ranks;

struct Item {
  std::int32_t from = 0, to = 0, place = 0;
  bool operator==(const Item&) const = default;
};

class Exchange : public testing::TestWithParam<std::size_t> {};

TEST_P(Exchange, brings_every_list_whole_and_in_order) {
  std::vector<std::vector<Item>> out(get_ranks());
  const auto length = [](int from, int to) { return 3 * from + 5 * to; };  // none from rank 0 to itself
  for (int to = 0; to < get_ranks(); ++to)
    for (int i = 0; i < length(get_rank(), to); ++i) out[to].push_back({get_rank(), to, i});
  const auto in = exchange_lists(MPI_COMM_WORLD, out, GetParam());
  ASSERT_EQ(in.size(), static_cast<std::size_t>(get_ranks()));
  for (int from = 0; from < get_ranks(); ++from) {
    ASSERT_EQ(in[from].size(), static_cast<std::size_t>(length(from, get_rank())));
    for (int i = 0; i < length(from, get_rank()); ++i) EXPECT_EQ(in[from][i], (Item{from, get_rank(), i}));
  }
}

// Every rank owns nine nodes and uses all nodes of all others.
TEST_P(Exchange, copies_and_sums_shared_nodes) {
  constexpr int kOwned = 9;
  constexpr std::size_t kWidth = 3;
  fem::LocalMesh local;
  local.owned_nodes = local.free_nodes = kOwned;
  for (int rank = 0; rank < get_ranks(); ++rank)
    for (int i = 0; i < kOwned; ++i) local.node_in_mesh.push_back(((get_rank() + rank) % get_ranks()) * kOwned + i);
  local.nodes_m.resize(local.node_in_mesh.size());
  std::vector<std::int32_t> place;
  for (std::size_t i = 0; i < local.node_in_mesh.size(); ++i) place.push_back(static_cast<std::int32_t>(local.node_in_mesh.size() - 1 - i));
  NodeExchange exchange(MPI_COMM_WORLD, local, place, GetParam());

  std::vector<double> values(kWidth * place.size(), -1.0);
  const auto value_of = [&](std::size_t node, std::size_t d) -> double& { return values[kWidth * place[node] + d]; };
  for (std::size_t n = 0; n < kOwned; ++n)
    for (std::size_t d = 0; d < kWidth; ++d) value_of(n, d) = 10.0 * local.node_in_mesh[n] + static_cast<double>(d);
  exchange.copy_to_halo(values.data(), kWidth);
  for (std::size_t n = 0; n < place.size(); ++n)
    for (std::size_t d = 0; d < kWidth; ++d) EXPECT_EQ(value_of(n, d), 10.0 * local.node_in_mesh[n] + static_cast<double>(d));

  for (double& value : values) value = 1.0 + get_rank();
  exchange.sum(values.data(), kWidth);
  for (const double value : values) EXPECT_EQ(value, get_ranks() * (get_ranks() + 1) / 2.0);
}

INSTANTIATE_TEST_SUITE_P(Pieces, Exchange, testing::Values(1, 7, 24, kPieceBytes));

}  // namespace
}  // namespace carillon::estimate

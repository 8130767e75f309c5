#include "precompute/run/cut_mesh.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "precompute/comm/exchange.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/ldlt/mesh_order.hpp"

namespace carillon::run {
namespace {

using Ints = std::vector<std::int32_t>;

constexpr std::int64_t kNodesOfARank = 300;  // fewer: what travels in a solve is less than what the second cut costs
constexpr double kFullest = 1.5;             // elements of a rank over the mean

bool is_worth_it(const comm::Communicator& comm, std::int64_t nodes) { return comm.size() > 1 && nodes >= kNodesOfARank * comm.size(); }

/// The order of a mesh that is cut already, by the rows of that cut; and the rank of each element in the second cut, empty on all ranks
/// where that would be uneven. Collective.
std::shared_ptr<ldlt::MeshOrder> order_pieces(const comm::Communicator& comm, const partition::LocalMesh& first, Ints& ranks) {
  const Ints elements = comm.agree([&] {
    Ints rows;
    rows.reserve(first.tets.size());
    for (const std::int32_t node : first.tets) rows.push_back(first.row[static_cast<std::size_t>(node)]);
    return rows;
  });
  const int width = first.nodes_per_tet();
  auto order = std::make_shared<ldlt::MeshOrder>(comm, elements, width, comm::IndexPartition(comm, first.free_nodes));
  ranks = order->find_ranks(comm, elements, width);
  std::vector<std::int64_t> counts(static_cast<std::size_t>(comm.size()), 0);
  for (std::int32_t& rank : ranks) ++counts[static_cast<std::size_t>(rank = std::max(rank, 0))];  // all fixed: anywhere
  comm.sum(std::span<std::int64_t>(counts));
  std::int64_t all = 0;
  for (const std::int64_t count : counts) all += count;
  const auto [least, most] = std::minmax_element(counts.begin(), counts.end());
  if (*least == 0 || static_cast<double>(*most) * comm.size() > kFullest * static_cast<double>(all)) ranks = {};
  return order;
}

/// Rank 0: the rank of each element of the mesh. Collective.
Ints gather_ranks(const comm::Communicator& comm, const partition::LocalMesh& first, const Ints& ranks) {
  struct Moved {
    std::int32_t element, rank;
  };
  const std::vector<Moved> moved = comm::gather(comm, [&] {
    std::vector<Moved> list;
    for (std::size_t e = 0; e < ranks.size(); ++e) list.push_back({first.tet_in_mesh[e], ranks[e]});
    return list;
  });
  return comm.agree([&] {
    Ints part(moved.size());
    for (const Moved& one : moved) part[static_cast<std::size_t>(one.element)] = one.rank;
    return part;
  });
}

}  // namespace

CutMesh cut_by_order(const comm::Communicator& comm, const mesh::TetMesh& mesh, const Ints& fixed_nodes) {
  CutMesh cut;
  cut.pieces = partition::distribute(comm, mesh, fixed_nodes);
  if (!is_worth_it(comm, cut.pieces.free_nodes)) return cut;
  Ints ranks;
  const std::shared_ptr<ldlt::MeshOrder> order = order_pieces(comm, cut.pieces.local, ranks);
  cut.order = order;
  const partition::LocalMesh& first = cut.pieces.local;
  cut.is_by_order = comm.sum(static_cast<std::int64_t>(ranks.size())) > 0;
  if (!cut.is_by_order) {
    order->renumber(comm, Ints(first.row.begin(), first.row.begin() + first.free_nodes));
    return cut;
  }
  Ints part = gather_ranks(comm, first, ranks);
  const Ints nodes(first.node_in_mesh.begin(), first.node_in_mesh.begin() + first.free_nodes);
  cut.pieces = {};
  cut.pieces = partition::distribute(comm, mesh, fixed_nodes, {.part = std::move(part)});
  order->renumber(comm, comm::query_owners<std::int32_t>(
                            comm, nodes, [](std::int32_t) { return 0; },
                            [&](std::int32_t node) { return cut.pieces.row_of_node[static_cast<std::size_t>(node)]; }));
  return cut;
}

RecutByOrder::RecutByOrder(const comm::Communicator& comm) : comm_(comm) {}

parallel_mesh::Recut RecutByOrder::make_recut() {
  return {[this](std::int64_t nodes) { return is_worth_it(comm_, nodes); },
          [this](const partition::LocalMesh& first) {
            Ints ranks;
            order_ = order_pieces(comm_, first, ranks);
            is_used_ = comm_.sum(static_cast<std::int64_t>(ranks.size())) > 0;
            return ranks;
          },
          [this](const Ints& rows) { order_->renumber(comm_, rows); }};
}

}  // namespace carillon::run

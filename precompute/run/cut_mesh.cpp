#include "precompute/run/cut_mesh.hpp"

#include <algorithm>
#include <utility>

#include "precompute/comm/exchange.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/ldlt/mesh_order.hpp"
#include "precompute/mesh/distributed/level_elements.hpp"

namespace carillon::run {
namespace {

using Ints = std::vector<std::int32_t>;

constexpr std::int64_t kNodesOfARank = 300;  // minimum: below it the second cut costs more than it saves

bool is_worth_it(const comm::Communicator& comm, std::int64_t nodes) { return comm.size() > 1 && nodes >= kNodesOfARank * comm.size(); }

struct OrderedPieces {
  std::shared_ptr<ldlt::MeshOrder> order;  // by the node numbers before the cut
  Ints ranks;                              // of each of this rank's elements after the cut
};

/// tets: nodes of this rank's elements; numbers: of these nodes, -1: fixed; own_nodes: number owned by this rank. Collective.
OrderedPieces order_pieces(const comm::Communicator& comm, const Ints& tets, int width, const Ints& numbers, std::int64_t own_nodes) {
  const Ints elements = comm.agree([&] {
    Ints list;
    list.reserve(tets.size());
    for (const std::int32_t node : tets) list.push_back(numbers[node]);
    return list;
  });
  OrderedPieces pieces;
  pieces.order = std::make_shared<ldlt::MeshOrder>(comm, elements, width, comm::IndexPartition(comm, own_nodes));
  ldlt::ElementRanks ranks = pieces.order->find_ranks(comm, elements, width);
  for (std::size_t e = 0; e < ranks.rank.size(); ++e)
    if (ranks.rank[e] < 0) {  // all nodes are fixed: any rank will do
      ranks.rank[e] = 0;
      ranks.position[e] = -1 - static_cast<std::int32_t>(e);
    }
  mesh::level_elements(comm, ranks.rank, ranks.position);
  pieces.ranks = std::move(ranks.rank);
  return pieces;
}

OrderedPieces order_pieces(const comm::Communicator& comm, const mesh::LocalMesh& first) {
  return order_pieces(comm, first.tets, first.nodes_per_tet(), first.row, first.free_nodes);
}

/// Rank 0: target rank of each element of the mesh. Collective.
Ints gather_ranks(const comm::Communicator& comm, const mesh::DistributedMesh& first, const Ints& ranks) {
  return comm::report_to_owners<std::int32_t>(
      comm,
      [&] {
        std::vector<comm::Reported<std::int32_t>> list;
        for (std::size_t e = 0; e < ranks.size(); ++e) list.push_back({first.local.tet_in_mesh[e], ranks[e]});
        return list;
      },
      comm::IndexPartition(comm, comm.is_root() ? first.tets : 0));
}

/// Rank 0 orders the undistributed mesh. free_nodes: on rank 0. Collective.
CutMesh cut_once(const comm::Communicator& comm, const mesh::TetMesh& mesh, const Ints& fixed_nodes, const Ints& free_nodes) {
  const Ints numbers = comm.agree([&] {
    Ints list(comm.is_root() ? mesh.nodes_m.size() : 0, -1);
    for (std::size_t i = 0; i < free_nodes.size(); ++i) list[free_nodes[i]] = static_cast<std::int32_t>(i);
    return list;
  });
  const int width = comm.broadcast(mesh.nodes_per_tet());
  const Ints none;
  OrderedPieces ordered =
      order_pieces(comm, comm.is_root() ? mesh.tets : none, width, numbers, static_cast<std::int64_t>(free_nodes.size()));
  CutMesh cut;
  cut.order = ordered.order;
  cut.pieces = mesh::distribute(comm, mesh, fixed_nodes, {.part = std::move(ordered.ranks)});
  const Ints rows = comm.agree([&] {
    Ints list;
    for (const std::int32_t node : free_nodes) list.push_back(cut.pieces.row_of_node[node]);
    return list;
  });
  ordered.order->renumber(comm, rows);
  return cut;
}

/// For meshes too large for one rank: METIS distributes them first. Collective.
CutMesh cut_twice(const comm::Communicator& comm, const mesh::TetMesh& mesh, const Ints& fixed_nodes) {
  CutMesh cut;
  cut.pieces = mesh::distribute(comm, mesh, fixed_nodes);
  const OrderedPieces ordered = order_pieces(comm, cut.pieces.local);
  cut.order = ordered.order;
  const mesh::LocalMesh& first = cut.pieces.local;
  const Ints nodes(first.node_in_mesh.begin(), first.node_in_mesh.begin() + first.free_nodes);
  Ints part = gather_ranks(comm, cut.pieces, ordered.ranks);
  cut.pieces = {};
  cut.pieces = mesh::distribute(comm, mesh, fixed_nodes, {.part = std::move(part)});
  ordered.order->renumber(
      comm, comm::query_owners<std::int32_t>(
                comm, nodes, [](std::int32_t) { return 0; }, [&](std::int32_t node) { return cut.pieces.row_of_node[node]; }));
  return cut;
}

}  // namespace

CutMesh cut_by_order(const comm::Communicator& comm, const mesh::TetMesh& mesh, const Ints& fixed_nodes, std::int32_t largest_ordered) {
  const Ints free_nodes = comm.agree([&] { return comm.is_root() && comm.size() > 1 ? mesh::list_free_nodes(mesh, fixed_nodes) : Ints(); });
  const auto count = comm.broadcast(static_cast<std::int64_t>(free_nodes.size()));
  if (!is_worth_it(comm, count)) {
    CutMesh cut;
    cut.pieces = mesh::distribute(comm, mesh, fixed_nodes);
    return cut;
  }
  return count <= largest_ordered ? cut_once(comm, mesh, fixed_nodes, free_nodes) : cut_twice(comm, mesh, fixed_nodes);
}

RecutByOrder::RecutByOrder(const comm::Communicator& comm) : comm_(comm) {}

parallel_mesh::Recut RecutByOrder::make_recut() {
  return {[this](std::int64_t nodes) { return is_worth_it(comm_, nodes); },
          [this](const mesh::LocalMesh& first) {
            OrderedPieces ordered = order_pieces(comm_, first);
            order_ = std::move(ordered.order);
            return std::move(ordered.ranks);
          },
          [this](const Ints& rows) { order_->renumber(comm_, rows); }};
}

}  // namespace carillon::run

// Method: The holders of the parts of the tree report the costs of their fronts to all ranks, small subtrees as one; every rank computes
// the same mapping from them. Then each front is sent, with its rows, to all ranks that need it.
// Source: Pothen and Sun 1993 (mapping.cpp).
#include "precompute/ldlt/deal.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "precompute/comm/exchange.hpp"
#include "precompute/ldlt/lists.hpp"

namespace carillon::ldlt {
namespace {

using comm::Communicator;

constexpr double kWhole = 0.03;  // fraction of a rank's work: smaller subtrees are mapped as one

/// A front, or a subtree treated as one front, for the mapping.
struct FrontRecord {
  std::int32_t id;
  FrontCost cost;  // parent: front id
};

/// Fronts of a part that are mapped individually or as root of a whole subtree.
struct Pruning {
  std::vector<double> operations, entries;  // (supernodes) of the subtrees
  std::vector<bool> is_whole;               // (supernodes)
};

Pruning prune(const HeldPart& held, bool is_leaf, double most_operations, double most_entries) {
  const std::vector<Supernode>& nodes = held.forest.supernodes;
  Pruning pruning{std::vector<double>(nodes.size(), 0.0), std::vector<double>(nodes.size(), 0.0), std::vector<bool>(nodes.size(), false)};
  for (std::size_t s = 0; s < nodes.size(); ++s) {
    pruning.operations[s] += count_flops(nodes[s].width, nodes[s].size());
    pruning.entries[s] += static_cast<double>(count_entries(nodes[s].width, nodes[s].size()));
    pruning.is_whole[s] = is_leaf && pruning.operations[s] < most_operations && pruning.entries[s] < most_entries;
    if (nodes[s].parent < 0) continue;
    pruning.operations[nodes[s].parent] += pruning.operations[s];
    pruning.entries[nodes[s].parent] += pruning.entries[s];
  }
  return pruning;
}

}  // namespace

MappedFronts map_fronts(const Communicator& comm, Elimination elimination) {
  MappedFronts fronts{std::move(elimination), {}, {}};
  const Elimination& all = fronts.elimination;
  double total[2] = {0, 0};
  for (const HeldPart& held : all.parts)
    for (const Supernode& node : held.forest.supernodes) {
      total[0] += count_flops(node.width, node.size());
      total[1] += static_cast<double>(count_entries(node.width, node.size()));
    }
  comm.sum(std::span<double>(total));
  std::vector<FrontRecord> records = comm.all_gather([&] {
    std::vector<FrontRecord> own;
    for (const HeldPart& held : all.parts) {
      const TreePart& part = all.tree.parts[held.part];
      const std::vector<Supernode>& nodes = held.forest.supernodes;
      const Pruning pruning = prune(held, part.is_leaf(), kWhole * total[0] / comm.size(), kWhole * total[1] / comm.size());
      for (std::size_t s = 0; s < nodes.size(); ++s) {
        if (nodes[s].parent >= 0 && pruning.is_whole[nodes[s].parent]) continue;
        FrontRecord& record = own.emplace_back();
        record.id = part.first_front + static_cast<std::int32_t>(s);
        record.cost = {held.parents[s], nodes[s].width, static_cast<std::int32_t>(nodes[s].rows.size()),
                       pruning.is_whole[s] ? pruning.operations[s] : count_flops(nodes[s].width, nodes[s].size()),
                       pruning.is_whole[s] ? pruning.entries[s] : static_cast<double>(count_entries(nodes[s].width, nodes[s].size()))};
      }
    }
    return own;
  });
  comm.agree([&] {
    SharedMapping& shared = fronts.shared;
    std::sort(records.begin(), records.end(), [](const FrontRecord& a, const FrontRecord& b) { return a.id < b.id; });
    for (const FrontRecord& record : records) shared.ids.push_back(record.id);
    for (const FrontRecord& record : records) {
      shared.costs.push_back(record.cost);
      if (record.cost.parent >= 0) shared.costs.back().parent = shared.find(record.cost.parent);
    }
    shared.mapping = choose_mapping(shared.costs, comm.size());
    shared.order.assign(shared.ids.size(), -1);
    const std::vector<std::int32_t> order = order_shared(shared.costs, shared.mapping);
    for (std::size_t k = 0; k < order.size(); ++k) shared.order[order[k]] = static_cast<std::int32_t>(k);
    for (std::size_t h = 0; h < all.parts.size(); ++h) {
      const std::vector<Supernode>& nodes = all.parts[h].forest.supernodes;
      Ints& owner = fronts.owners.emplace_back(nodes.size(), -1);
      for (std::size_t s = nodes.size(); s-- > 0;) {
        const std::int32_t at = shared.find(all.tree.parts[all.parts[h].part].first_front + static_cast<std::int32_t>(s));
        owner[s] = at >= 0 ? shared.mapping.owner(at) : owner[nodes[s].parent];
      }
    }
  });
  return fronts;
}

std::vector<DealtFront> deal_fronts(const Communicator& comm, const MappedFronts& fronts) {
  const Elimination& all = fronts.elimination;
  const SharedMapping& shared = fronts.shared;
  const std::vector<Ints>& owners = fronts.owners;
  const auto received = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(comm.size());
    for (std::size_t h = 0; h < all.parts.size(); ++h) {
      const HeldPart& held = all.parts[h];
      const TreePart& part = all.tree.parts[held.part];
      for (std::size_t s = 0; s < held.forest.supernodes.size(); ++s) {
        const Supernode& node = held.forest.supernodes[s];
        const std::int32_t above = held.parents[s] < 0 ? -1 : shared.find(held.parents[s]);
        Ints ranks;
        if (above >= 0 && shared.mapping.owner(above) < 0) {
          for (const FrontShare& share : shared.mapping.list_shares(above)) ranks.push_back(share.rank);
        } else if (owners[h][s] < 0) {
          for (const FrontShare& share : shared.mapping.list_shares(shared.find(part.first_front + static_cast<std::int32_t>(s))))
            ranks.push_back(share.rank);
        }
        if (owners[h][s] >= 0 && std::find(ranks.begin(), ranks.end(), owners[h][s]) == ranks.end()) ranks.push_back(owners[h][s]);
        for (const std::int32_t rank : ranks) {
          Ints& list = lists[rank];
          list.insert(list.end(), {part.first_front + static_cast<std::int32_t>(s), held.parents[s], owners[h][s], node.first, node.width,
                                   static_cast<std::int32_t>(node.rows.size())});
          const auto nodes = held.nodes.begin() + (node.first - part.first);
          list.insert(list.end(), nodes, nodes + node.width);
          list.insert(list.end(), node.rows.begin(), node.rows.end());
        }
      }
    }
    return join(lists);
  });
  return comm.agree([&] {
    std::vector<DealtFront> fronts;
    for (ListReader reader(received.items); !reader.is_at_end();) {
      DealtFront& front = fronts.emplace_back();
      front.id = reader.next();
      front.parent = reader.next();
      front.owner = reader.next();
      front.first = reader.next();
      const std::int32_t width = reader.next();
      const std::int32_t rows = reader.next();
      front.nodes = reader.take(width);
      front.rows = reader.take(rows);
    }
    std::sort(fronts.begin(), fronts.end(), [](const DealtFront& a, const DealtFront& b) { return a.id < b.id; });
    return fronts;
  });
}

}  // namespace carillon::ldlt

// Method: A rank knows its own subtrees and the shared fronts between them and the root (deal.cpp). It asks the owners of the matrix rows
// for the pattern of the columns in which it has pivots or tiles. Memory layout of own fronts: room.cpp.
// Source: Pothen and Sun 1993 (mapping.cpp).
#include "precompute/ldlt/plan.hpp"

#include <algorithm>
#include <optional>
#include <unordered_map>

#include "precompute/comm/exchange.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/la/node_rows.hpp"
#include "precompute/ldlt/deal.hpp"
#include "precompute/ldlt/lists.hpp"
#include "precompute/ldlt/mesh_order.hpp"
#include "precompute/ldlt/storage.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::ldlt {
namespace {

using comm::Communicator;
using comm::IndexPartition;
using petsc::check;

/// A column of A in which this rank has pivots, of its own fronts (front -1) or of a shared one.
struct WantedColumn {
  std::int32_t node = 0;    // global
  std::int32_t front = -1;  // among the shared fronts
  std::int32_t column = 0;  // local node, or node of the shared front
};

/// Builds the plan of a rank from the fronts assigned to it.
class PlanMaker {
 public:
  PlanMaker(Plan& plan, const NodeLinks& nodes, const IndexPartition& owners, std::vector<DealtFront> dealt, const SharedMapping& mapping)
      : plan_(plan), nodes_(nodes), owners_(owners), dealt_(std::move(dealt)), mapping_(mapping) {}

  void add_fronts() {
    plan_.own_nodes = nodes_.own_nodes;
    add_own_fronts();
    add_shared_fronts();
    for (std::size_t s = plan_.fronts.size(); s-- > 0;) {
      Front& front = plan_.fronts[s];
      if (front.parent >= 0) front.depth = plan_.fronts[front.parent].depth + 1;
    }
    for (std::size_t s = 0; s < plan_.fronts.size(); ++s)
      if (plan_.fronts[s].parent >= 0) plan_.fronts[plan_.fronts[s].parent].children.push_back(static_cast<std::int32_t>(s));
  }

  /// Columns needed from the owners of matrix rows; own columns of own fronts are excluded.
  std::vector<WantedColumn> list_wanted() const {
    std::vector<WantedColumn> wanted;
    for (std::int32_t p = 0; p < plan_.pivot_nodes; ++p)
      if (owners_.find_owner(node_of_pivot_[p]) != plan_.rank) wanted.push_back({node_of_pivot_[p], -1, p});
    for (std::size_t f = 0; f < plan_.shared.size(); ++f) {
      const SharedFront& front = plan_.shared[f];
      for (std::int32_t c = 0; c < front.width; ++c)
        if (front.map.has_column(front.place, front.map.find_tile(c)))
          wanted.push_back({shared_nodes_[f][c], static_cast<std::int32_t>(f), c});
    }
    return wanted;
  }

  /// Nodes of the pivots solved on this rank, and their slots.
  std::vector<std::pair<std::int32_t, std::int32_t>> list_homes() const {
    std::vector<std::pair<std::int32_t, std::int32_t>> homes;
    for (std::int32_t p = 0; p < plan_.pivot_nodes; ++p) homes.emplace_back(node_of_pivot_[p], p);
    for (std::size_t f = 0; f < plan_.shared.size(); ++f) {
      const SharedFront& front = plan_.shared[f];
      for (int k = 0; k < front.map.pivot_tiles(); ++k)
        for (std::int32_t c = front.map.start(k); front.map.owner(k, k) == front.place && c < front.map.start(k + 1); ++c)
          homes.emplace_back(shared_nodes_[f][c], front.first_slot + front.row_begin[k] + c - front.map.start(k));
    }
    return homes;
  }

  std::int32_t find_local(std::int32_t position) const {
    const auto at = local_of_.find(position);
    return at == local_of_.end() ? -1 : at->second;
  }

  /// Node of a shared front at a position, -1: none.
  std::int32_t find_node(std::int32_t front, std::int32_t position) const {
    const DealtFront& dealt = dealt_[shared_dealt_[front]];
    return find_node(dealt, position);
  }

 private:
  static std::int32_t find_node(const DealtFront& front, std::int32_t position) {
    if (position >= front.first && position < front.first + front.width()) return position - front.first;
    const auto at = std::lower_bound(front.rows.begin(), front.rows.end(), position);
    return at != front.rows.end() && *at == position ? front.width() + static_cast<std::int32_t>(at - front.rows.begin()) : -1;
  }

  /// Own fronts in postorder; parts of the tree interleave them.
  void add_own_fronts() {
    std::unordered_map<std::int32_t, std::int32_t> own_of;  // by id: index in dealt_
    for (std::size_t d = 0; d < dealt_.size(); ++d)
      if (dealt_[d].owner == plan_.rank) own_of.emplace(dealt_[d].id, static_cast<std::int32_t>(d));
    std::vector<Ints> children(dealt_.size());
    Ints roots;
    for (std::size_t d = 0; d < dealt_.size(); ++d) {
      if (dealt_[d].owner != plan_.rank) continue;
      const auto parent = own_of.find(dealt_[d].parent);
      (parent == own_of.end() ? roots : children[parent->second]).push_back(static_cast<std::int32_t>(d));
    }
    sort_by_room(dealt_, children, roots);
    Ints order;
    Ints stack(roots.begin(), roots.end());
    while (!stack.empty()) {  // filled in reverse: parents before children
      const std::int32_t d = stack.back();
      stack.pop_back();
      order.push_back(d);
      stack.insert(stack.end(), children[d].begin(), children[d].end());
    }
    std::reverse(order.begin(), order.end());
    std::unordered_map<std::int32_t, std::int32_t> front_of;
    std::int32_t pivots = 0;
    for (const std::int32_t d : order) {
      const DealtFront& dealt = dealt_[d];
      for (std::int32_t k = 0; k < dealt.width(); ++k) {
        local_of_.emplace(dealt.first + k, pivots++);
        node_of_pivot_.push_back(dealt.nodes[k]);
      }
      front_of.emplace(dealt.id, static_cast<std::int32_t>(front_of.size()));
    }
    plan_.pivot_nodes = pivots;
    Ints behind;
    for (const std::int32_t d : order)
      for (const std::int32_t row : dealt_[d].rows)
        if (!local_of_.contains(row)) behind.push_back(row);
    std::sort(behind.begin(), behind.end());
    behind.erase(std::unique(behind.begin(), behind.end()), behind.end());
    for (const std::int32_t row : behind) local_of_.emplace(row, static_cast<std::int32_t>(local_of_.size()));
    plan_.local_nodes = static_cast<std::int32_t>(local_of_.size());
    for (const std::int32_t d : order) {
      const DealtFront& dealt = dealt_[d];
      Front& front = plan_.fronts.emplace_back();
      front.first = local_of_.at(dealt.first);
      front.width = dealt.width();
      for (const std::int32_t row : dealt.rows) front.rows.push_back(local_of_.at(row));
      std::sort(front.rows.begin(), front.rows.end());
      const auto parent = front_of.find(dealt.parent);
      front.parent = parent == front_of.end() ? -1 : parent->second;
    }
    own_front_of_ = std::move(front_of);
  }

  std::vector<FrontShare> list_shares(const DealtFront& front) const {
    return front.owner >= 0 ? std::vector<FrontShare>{{front.owner, 1.0}} : mapping_.mapping.list_shares(mapping_.find(front.id));
  }

  void add_shared_fronts() {
    std::vector<std::pair<std::int32_t, std::int32_t>> order;  // position among all shared fronts, dealt front
    for (std::size_t d = 0; d < dealt_.size(); ++d) {
      if (dealt_[d].owner >= 0) continue;
      bool is_shared_here = false;
      for (const FrontShare& share : list_shares(dealt_[d])) is_shared_here = is_shared_here || share.rank == plan_.rank;
      if (is_shared_here) order.emplace_back(mapping_.order[mapping_.find(dealt_[d].id)], static_cast<std::int32_t>(d));
    }
    std::sort(order.begin(), order.end());
    std::unordered_map<std::int32_t, std::int32_t> shared_of;
    std::int32_t slot = plan_.local_nodes;
    for (const auto& [place, d] : order) {
      const DealtFront& dealt = dealt_[d];
      shared_of.emplace(dealt.id, static_cast<std::int32_t>(plan_.shared.size()));
      shared_dealt_.push_back(d);
      shared_nodes_.push_back(dealt.nodes);
      const auto rows = static_cast<std::int32_t>(dealt.rows.size());
      const SharedFront& front =
          plan_.shared.emplace_back(dealt.id, dealt.width(), TileMap(dealt.width(), rows, list_shares(dealt)), plan_.rank, slot);
      slot += front.own_nodes();
    }
    plan_.given_slots = slot;
    for (std::size_t d = 0; d < dealt_.size(); ++d) {
      const auto above = shared_of.find(dealt_[d].parent);
      if (above == shared_of.end()) continue;
      SharedFront& parent = plan_.shared[above->second];
      const auto rows = static_cast<std::int32_t>(dealt_[d].rows.size());
      SharedChild child{TileMap(dealt_[d].width(), rows, list_shares(dealt_[d])), dealt_[d].width(), {}, {}, -1, -1};
      for (const std::int32_t row : dealt_[d].rows) child.node_of_row.push_back(find_node(above->second, row));
      const auto place = static_cast<std::int32_t>(parent.children.size());
      if (dealt_[d].owner == plan_.rank) {
        child.front = own_front_of_.at(dealt_[d].id);
        Front& front = plan_.fronts[child.front];
        front.shared_parent = above->second;
        front.place_in_parent = place;
      } else if (const auto at = shared_of.find(dealt_[d].id); at != shared_of.end()) {
        child.shared = at->second;
        plan_.shared[at->second].parent = above->second;
        plan_.shared[at->second].place_in_parent = place;
      }
      add_messages(dealt_[d].id, parent, child);
      parent.children.push_back(std::move(child));
    }
  }

  /// Messages from the ranks of a child to those of its parent: tiles in a factorisation, partial sums in a solve.
  void add_messages(std::int32_t id, SharedFront& parent, SharedChild& child) {
    const auto slot_in = [](const SharedFront& front, std::int32_t node) {
      const int i = front.map.find_tile(node);
      return front.first_slot + front.row_begin[i] + node - front.map.start(i);
    };
    for (int from = 0; from < child.map.places(); ++from) {
      std::int64_t numbers = 0;
      for_pieces(child, from, parent.map, parent.place, [&](const Piece& piece) { numbers += piece.count(); });
      child.arriving.push_back(numbers);
      SumMessage sums{child.map.rank(from), id, {}};
      for_sums(child, from, parent.map, parent.place, [&](std::int32_t a) { sums.slots.push_back(slot_in(parent, child.node_of_row[a])); });
      if (!sums.slots.empty()) parent.from_children.push_back(std::move(sums));
    }
    const int place = child.map.find_place(plan_.rank);
    if (place < 0) return;
    for (int to = 0; to < parent.map.places(); ++to) {
      SumMessage sums{parent.map.rank(to), id, {}};
      for_sums(child, place, parent.map, to, [&](std::int32_t a) {
        sums.slots.push_back(child.front >= 0 ? plan_.fronts[child.front].rows[a] : slot_in(plan_.shared[child.shared], child.width + a));
      });
      if (sums.slots.empty()) continue;
      (child.front >= 0 ? plan_.fronts[child.front].to_parent : plan_.shared[child.shared].to_parent).push_back(std::move(sums));
    }
  }

  Plan& plan_;
  const NodeLinks& nodes_;
  const IndexPartition& owners_;
  std::vector<DealtFront> dealt_;
  const SharedMapping& mapping_;
  std::unordered_map<std::int32_t, std::int32_t> local_of_;      // by position
  std::unordered_map<std::int32_t, std::int32_t> own_front_of_;  // by id
  Ints node_of_pivot_;                                           // (pivot_nodes) global
  Ints shared_dealt_;                                            // (shared fronts) index in dealt_
  std::vector<Ints> shared_nodes_;                               // (shared fronts) global numbers of the pivots
};

[[noreturn]] void refuse_order() { throw InputError("The elimination order lacks links of K or M."); }

/// Checks that the fronts of this rank contain all rows of K and M in their columns.
void check_fronts(const Plan& plan, const NodeLinks& nodes) {
  Ints front_of(plan.local_nodes, -1);  // last front that contains the row
  std::vector<std::size_t> next(plan.received.size(), 0);
  for (std::size_t s = 0; s < plan.fronts.size(); ++s) {
    const Front& front = plan.fronts[s];
    const std::int32_t behind = front.first + front.width;
    for (const std::int32_t row : front.rows) front_of[row] = static_cast<std::int32_t>(s);
    const auto check_row = [&](std::int32_t row) {
      if (row < 0 || (row >= behind && front_of[row] != static_cast<std::int32_t>(s))) refuse_order();
    };
    for (std::int32_t pivot = front.first; pivot < behind; ++pivot) {
      const std::int32_t v = plan.own_of_pivot[pivot];
      if (v < 0) continue;  // received from another rank
      for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u) check_row(plan.node_of_link[*u]);
    }
    for (std::size_t l = 0; l < plan.received.size(); ++l) {  // columns ascend, as fronts do
      const ReceivedBlocks& list = plan.received[l];
      for (std::size_t& k = next[l]; k < list.columns.size() && list.columns[k] < behind; ++k) check_row(list.rows[k]);
    }
  }
}

/// Requests the pattern of columns that come from other ranks, or go into shared fronts. Collective.
void plan_blocks(const Communicator& comm, Plan& plan, const PlanMaker& maker, const NodeLinks& nodes, const IndexPartition& owners,
                 const Ints& position) {
  const auto wanted = comm.agree([&] {
    return comm::sort_by_receiver(comm.size(), maker.list_wanted(), [&](const WantedColumn& one) { return owners.find_owner(one.node); });
  });
  const auto asked = comm::all_to_all(comm, wanted);
  const auto answers = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(comm.size());
    for (int rank = 0; rank < comm.size(); ++rank) {
      SentBlocks sent;
      sent.rank = rank;
      Ints& list = lists[rank];
      for (const WantedColumn& column : asked.of(rank)) {
        const auto own = static_cast<std::int32_t>(owners.to_local(column.node));
        const std::int32_t at = position[own];
        const std::size_t count = list.size();
        list.push_back(0);
        const auto add = [&](std::int32_t link) {
          if (position[link] < at) return;
          sent.columns.push_back(own);
          sent.rows.push_back(link);
          list.push_back(position[link]);
        };
        add(own);
        for (const std::int32_t* u = nodes.links.begin(own); u != nodes.links.end(own); ++u) add(*u);
        list[count] = static_cast<std::int32_t>(list.size() - count) - 1;
      }
      if (!sent.columns.empty()) plan.sent.push_back(std::move(sent));
    }
    return join(lists);
  });
  comm.agree([&] {
    for (int rank = 0; rank < comm.size(); ++rank) {
      ReceivedBlocks received;
      received.rank = rank;
      ListReader reader(answers.of(rank));
      for (const WantedColumn& column : wanted.of(rank))
        for (std::int32_t left = reader.next(); left > 0; --left) {
          const std::int32_t at = reader.next();
          if (column.front < 0) {
            received.columns.push_back(column.column);
            received.rows.push_back(maker.find_local(at));
            continue;
          }
          const SharedFront& front = plan.shared[column.front];
          const std::int32_t row = maker.find_node(column.front, at);
          if (row < 0) refuse_order();
          const bool is_here = front.map.has_row(front.place, front.map.find_tile(row));
          received.shared.push_back({column.front, column.column, is_here ? row : -1});
        }
      if (received.count() > 0) plan.received.push_back(std::move(received));
    }
  });
}

/// Reports to the owners of matrix rows the rank that solves for each row. Collective.
void plan_rows(const Communicator& comm, Plan& plan, const PlanMaker& maker, const IndexPartition& owners) {
  struct Home {
    std::int32_t node, slot;
  };
  const auto homes = comm.agree([&] {
    std::vector<Home> list;
    for (const auto& [node, slot] : maker.list_homes()) list.push_back({node, slot});
    return comm::sort_by_receiver(comm.size(), list, [&](const Home& one) { return owners.find_owner(one.node); });
  });
  const auto reported = comm::all_to_all(comm, homes);
  comm.agree([&] {
    plan.slots = plan.given_slots;
    plan.slot_of_own.assign(plan.own_nodes, -1);
    for (int rank = 0; rank < comm.size(); ++rank) {
      const auto given = reported.of(rank);
      if (rank != comm.rank() && !given.empty()) {
        plan.given.push_back({rank, plan.slots, static_cast<std::int32_t>(given.size())});
        for (const Home& one : given) plan.slot_of_own[owners.to_local(one.node)] = plan.slots++;
      }
      if (rank == comm.rank())
        for (const Home& one : given) plan.slot_of_own[owners.to_local(one.node)] = one.slot;
      if (rank == comm.rank() || homes.of(rank).empty()) continue;
      TakenRows& taken = plan.taken.emplace_back();
      taken.rank = rank;
      for (const Home& one : homes.of(rank)) taken.slots.push_back(one.slot);
    }
  });
}

/// Memory layout, peak memory, entries and flops of this rank.
Analysis::Rank measure(Plan& plan) {
  Analysis::Rank own;
  std::int64_t leaving = 0;  // contribution blocks sent to shared fronts, possibly not received yet
  std::int64_t scratch = 0;
  for (const Front& front : plan.fronts) {
    own.entries += count_entries(front.width, front.size());
    own.flops += count_flops(front.width, front.size());
    scratch = std::max(scratch, count_wide(front.width, front.size()));
    if (front.shared_parent >= 0) leaving += count_update_of(front.rows);
  }
  std::int64_t kept = leaving;  // including letters of this rank to itself
  std::int64_t shared_columns = 0, shared_peak = 0;
  for (const SharedFront& front : plan.shared) {
    own.entries += front.map.count_entries()[front.place];
    own.flops += front.map.count_operations()[front.place];
    shared_columns += kColumnsBegin + front.count_pivot_columns();
    const std::int64_t update = front.count_update();  // sent to the parent
    const std::int64_t panels = std::int64_t{4} * 3 * kPanelNodes * 3 * (front.own_nodes() + std::int64_t{kWideRows});
    std::int64_t come = 0;  // from other ranks
    for (const SharedChild& child : front.children)
      for (int from = 0; from < child.map.places(); ++from)
        if (child.map.rank(from) != plan.rank) come += child.arriving[from];
    shared_peak = std::max(shared_peak, kept + update + std::max(come + panels, update));  // at the end the tiles are copied into letters
    kept += update;
    for (const SharedChild& child : front.children)
      if (child.shared >= 0) kept -= plan.shared[child.shared].count_update();
  }
  constexpr int kBlocks = kSolveColumns / kBlockColumns;
  const Room& room = plan.room = plan_room(plan.fronts, shared_columns, kBlocks, plan.count_block());
  // Peak of a factorisation, and of the later solves, whose right-hand sides use the freed memory.
  std::int64_t numbers = std::max(
      {room.numbers + leaving + scratch, room.panels + shared_peak, room.numbers + (kBlocks - room.solve_blocks) * plan.count_block()});
  for (const SentBlocks& list : plan.sent) numbers += 9 * static_cast<std::int64_t>(list.columns.size());
  for (const ReceivedBlocks& list : plan.received) numbers += 9 * static_cast<std::int64_t>(list.count());
  own.peak_bytes = 8 * numbers;
  return own;
}

void gather_analysis(Plan& plan, const Analysis::Rank& own, const Communicator& comm) {
  Analysis& all = plan.analysis;
  all.ranks = comm.all_gather(std::vector<Analysis::Rank>{own});
  for (const Analysis::Rank& rank : all.ranks) {
    all.entries += rank.entries;
    all.flops += rank.flops;
    all.peak_bytes += rank.peak_bytes;
    all.largest_peak_bytes = std::max(all.largest_peak_bytes, rank.peak_bytes);
  }
  // The first rank of a shared front counts it.
  std::int64_t counts[3] = {static_cast<std::int64_t>(plan.fronts.size()), 0, 0};
  for (const SharedFront& front : plan.shared) {
    if (front.place != 0) continue;
    ++counts[1];
    counts[2] += front.width;
  }
  counts[0] += counts[1];
  comm.sum(std::span<std::int64_t>(counts));
  all.supernodes = counts[0];
  all.shared_fronts = counts[1];
  all.shared_nodes = counts[2];
}

}  // namespace

SharedFront::SharedFront(std::int32_t id_, std::int32_t width_, TileMap map_, int rank, std::int32_t first_slot_)
    : id(id_), width(width_), map(std::move(map_)), place(map.find_place(rank)), first_slot(first_slot_) {
  row_begin.push_back(0);
  for (int i = 0; i < map.tiles(); ++i) {
    if (map.has_column(place, i)) column_tiles.push_back(i);
    row_begin.push_back(row_begin.back() + (map.has_row(place, i) ? map.nodes(i) : 0));
  }
  for (int other = 0; other < map.places(); ++other) last_columns.push_back(map.find_last_column(other));
  for (int k = 0; k < map.pivot_tiles(); ++k) {
    row_places.push_back(map.list_row(k));
    column_places.push_back(map.list_column(k));
  }
}

Plan make_plan(Mat stiffness, Mat mass, const MeshOrder* order) {
  Plan plan;
  const Communicator comm = petsc::get_communicator(stiffness);
  plan.comm = comm;
  plan.rank = comm.rank();
  NodeLinks nodes;
  comm.agree([&] {
    const NodeRows k(stiffness);
    const NodeRows m(mass);
    if (k.rows() % 3 != 0 || k.first_row() % 3 != 0)
      throw InputError("K of a factorisation must have whole nodes of three rows on each rank.");
    nodes = find_links(k, m);
  });
  const IndexPartition owners(comm, nodes.own_nodes);
  if (order != nullptr && order->node_count() != owners.total())
    throw InputError("The elimination order and K have different numbers of nodes.");
  std::optional<MappedFronts> made;
  if (order == nullptr) made = map_fronts(comm, eliminate_on_paper(comm, nodes, owners));
  const MappedFronts& fronts = order != nullptr ? order->get_fronts() : *made;
  const Ints position = made ? made->elimination.position : report_positions(comm, fronts.elimination, nodes, owners);
  std::vector<DealtFront> dealt = deal_fronts(comm, fronts);
  const SharedMapping mapping = fronts.shared;
  made.reset();  // the fronts of other ranks are no longer needed
  PlanMaker maker(plan, nodes, owners, std::move(dealt), mapping);
  comm.agree([&] { maker.add_fronts(); });
  plan_blocks(comm, plan, maker, nodes, owners, position);
  plan_rows(comm, plan, maker, owners);
  const Analysis::Rank own = comm.agree([&] {
    const NodeRows k(stiffness);
    const NodeRows m(mass);
    for (const std::int32_t at : position) plan.node_of_link.push_back(maker.find_local(at));
    plan.own_of_pivot.assign(plan.pivot_nodes, -1);
    for (std::int32_t v = 0; v < plan.own_nodes; ++v) {
      const std::int32_t node = plan.node_of_link[v];
      if (node >= 0 && node < plan.pivot_nodes) plan.own_of_pivot[node] = v;
    }
    const auto find_ghosts = [&](const NodeRows& rows, Ints& links) {
      for (PetscInt g = 0; g < rows.ghost_count(); ++g) links.push_back(nodes.find_ghost(rows.ghosts()[g] / 3));
    };
    find_ghosts(k, plan.link_of_ghost_k);
    find_ghosts(m, plan.link_of_ghost_m);
    if (order != nullptr) check_fronts(plan, nodes);
    return measure(plan);
  });
  gather_analysis(plan, own, comm);
  return plan;
}

}  // namespace carillon::ldlt

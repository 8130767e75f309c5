// Method:     Each rank orders its interior by METIS and eliminates it on paper; what the roots of its forest leave on the interface is
//             gathered, and every rank plans the interface alike (interface.cpp). Whatever two ranks have to agree upon follows from that
//             common knowledge, so no message is spent on the messages to come.
// Source:     Duff and Reid 1983; Liu 1992, The multifrontal method for sparse matrix solution: theory and practice (stack of update
//             matrices).
// Deviations: two stacks, for fronts of even and odd depth: a front and its children never share one, so an update matrix can be made while
//             those of the children are read, and nothing has to be moved.
#include "precompute/ldlt/plan.hpp"

#include <algorithm>
#include <numeric>

#include "precompute/ldlt/interface.hpp"
#include "precompute/ldlt/interior.hpp"
#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/local_rows.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::ldlt {
namespace {

using petsc::check;

bool leaves_rows(const Supernode& node) { return node.parent < 0 && !node.rows.empty(); }

/// Sends the rows of the interior's roots to everybody and plans the interface. Collective.
void plan_common(MPI_Comm comm, const Interior& interior, Interface& interface) {
  const auto count = static_cast<std::int32_t>(interior.own_node.size());
  Lists roots;
  double entries = 0;
  for (const Supernode& node : interior.forest.supernodes) {
    entries += static_cast<double>(count_entries(node.width, node.size()));
    if (!leaves_rows(node)) continue;
    for (const std::int32_t row : node.rows) roots.items.push_back(interior.boundary[row - count]);
    roots.close();
  }
  Ints first_of_rank;
  interface.hubs = gather_lists(comm, roots, first_of_rank);
  for (std::size_t rank = 0; rank + 1 < first_of_rank.size(); ++rank)
    interface.hub_rank.insert(interface.hub_rank.end(), static_cast<std::size_t>(first_of_rank[rank + 1] - first_of_rank[rank]),
                              static_cast<std::int32_t>(rank));
  std::vector<double> kept(first_of_rank.size() - 1);
  MPI_Allgather(&entries, 1, MPI_DOUBLE, kept.data(), 1, MPI_DOUBLE, comm);
  petsc::run_agreed(comm, [&] { plan_interface(interface, std::move(kept)); });
}

/// Makes a rank's own plan of the common one.
class PlanMaker {
 public:
  PlanMaker(Plan& plan, const NodeLinks& nodes, const Interface& interface) : plan_(plan), nodes_(nodes), interface_(interface) {}

  void number_nodes(const Interior& interior) {
    plan_.own_nodes = nodes_.own_nodes;
    plan_.interior_nodes = static_cast<std::int32_t>(interior.own_node.size());
    plan_.interior_fronts = static_cast<std::int32_t>(interior.forest.supernodes.size());
    front_of_.assign(interface_.owner.size(), -1);
    std::int32_t next = plan_.interior_fronts;
    for (std::size_t s = 0; s < front_of_.size(); ++s)
      if (interface_.owner[s] == plan_.rank) front_of_[s] = next++;
    touched_ = find_touched_positions(interface_, plan_.rank);
    local_of_position_.assign(interface_.nodes.size(), -1);
    for (std::size_t k = 0; k < touched_.size(); ++k) local_of_position_[touched_[k]] = plan_.interior_nodes + static_cast<std::int32_t>(k);
    plan_.local_nodes = plan_.interior_nodes + static_cast<std::int32_t>(touched_.size());
    plan_.node_of_own.assign(nodes_.own_nodes, -1);
    for (std::int32_t i = 0; i < plan_.interior_nodes; ++i) plan_.node_of_own[interior.own_node[i]] = i;
    for (std::int32_t i = interface_.first_of_rank[plan_.rank]; i < interface_.first_of_rank[plan_.rank + 1]; ++i)
      plan_.node_of_own[interface_.nodes[i] - nodes_.first_node] = find_local(i);
  }

  Ints find_ghosts(const LocalRows& rows) const {
    Ints local;
    for (PetscInt g = 0; g < rows.ghost_count(); ++g) {
      const std::int32_t index = interface_.find(rows.ghosts()[g] / 3);
      local.push_back(index < 0 ? -1 : find_local(index));
    }
    return local;
  }

  void add_interior_fronts(Interior& interior, const Ints& boundary_positions) {
    const Ints& hub_rank = interface_.hub_rank;
    auto hub = static_cast<std::int32_t>(std::lower_bound(hub_rank.begin(), hub_rank.end(), plan_.rank) - hub_rank.begin());
    for (Supernode& node : interior.forest.supernodes) {
      Front front;
      const bool leaves = leaves_rows(node);
      static_cast<Supernode&>(front) = std::move(node);
      for (std::int32_t& row : front.rows)
        if (row >= plan_.interior_nodes) row = local_of_position_[boundary_positions[row - plan_.interior_nodes]];
      if (leaves) {
        set_parent(front, interface_.forest.hub_parents[hub], hub);
        ++hub;
      }
      plan_.fronts.push_back(std::move(front));
    }
    for (std::int32_t s = plan_.interior_fronts; s-- > 0;) {
      Front& front = plan_.fronts[s];
      if (front.parent >= 0 && front.parent < plan_.interior_fronts) front.depth = plan_.fronts[front.parent].depth + 1;
    }
  }

  void add_interface_fronts() {
    const std::vector<Supernode>& supernodes = interface_.forest.supernodes;
    for (std::size_t s = 0; s < supernodes.size(); ++s) {
      if (interface_.owner[s] != plan_.rank) continue;
      Front front;
      front.is_interface = true;
      front.first = local_of_position_[supernodes[s].first];
      front.width = supernodes[s].width;
      for (const std::int32_t row : supernodes[s].rows) front.rows.push_back(local_of_position_[row]);
      if (supernodes[s].parent >= 0) set_parent(front, supernodes[s].parent, interface_.hubs.count() + static_cast<std::int32_t>(s));
      plan_.fronts.push_back(std::move(front));
    }
    for (std::int32_t h = 0; h < interface_.hubs.count(); ++h)
      if (interface_.forest.hub_parents[h] >= 0)
        add_remote_child(interface_.forest.hub_parents[h], interface_.hub_rank[h], h, interface_.hubs.begin(h), interface_.hubs.end(h));
    for (std::size_t s = 0; s < supernodes.size(); ++s)
      if (supernodes[s].parent >= 0)
        add_remote_child(supernodes[s].parent, interface_.owner[s], interface_.hubs.count() + static_cast<std::int32_t>(s),
                         supernodes[s].rows.data(), supernodes[s].rows.data() + supernodes[s].rows.size());
    for (std::size_t s = 0; s < plan_.fronts.size(); ++s)
      if (plan_.fronts[s].parent >= 0) plan_.fronts[plan_.fronts[s].parent].children.push_back(static_cast<std::int32_t>(s));
  }

  void add_meetings(int ranks) {
    const std::vector<Supernode>& supernodes = interface_.forest.supernodes;
    std::vector<Meeting> meetings(supernodes.size());
    for (int rank = 0; rank < ranks; ++rank) {
      const Ints touched = rank == plan_.rank ? touched_ : find_touched_positions(interface_, rank);
      auto at = touched.begin();
      for (std::size_t s = 0; s < supernodes.size(); ++s) {
        const auto begin = at;
        at = std::lower_bound(at, touched.end(), supernodes[s].first + supernodes[s].width);
        const bool is_mine = interface_.owner[s] == plan_.rank;
        if (begin == at || rank == interface_.owner[s] || !(is_mine || rank == plan_.rank)) continue;
        Ints nodes;
        for (auto p = begin; p != at; ++p) nodes.push_back(local_of_position_[*p]);
        if (is_mine)
          meetings[s].guests.push_back({rank, std::move(nodes)});
        else
          meetings[s].nodes = std::move(nodes);
      }
    }
    for (std::size_t s = 0; s < supernodes.size(); ++s) {
      meetings[s].owner = interface_.owner[s];
      meetings[s].tag = static_cast<int>(s);
      meetings[s].front = front_of_[s];
      if (meetings[s].front >= 0 || !meetings[s].nodes.empty()) plan_.meetings.push_back(std::move(meetings[s]));
    }
  }

  void add_blocks(int ranks) {
    std::vector<BlockList> sent(ranks);
    std::vector<BlockList> received(ranks);
    std::size_t s = 0;
    for (std::int32_t p = 0; p < interface_.count(); ++p) {
      while (p >= interface_.forest.supernodes[s].first + interface_.forest.supernodes[s].width) ++s;
      const std::int32_t i = interface_.index[p];
      const int from = find_rank(interface_.first_of_rank, i);
      const int to = interface_.owner[s];
      if (from != plan_.rank && to != plan_.rank) continue;
      Ints rows{p};
      for (const std::int32_t* j = interface_.links.begin(i); j != interface_.links.end(i); ++j)
        if (interface_.position[*j] > p) rows.push_back(interface_.position[*j]);
      std::sort(rows.begin(), rows.end());
      for (const std::int32_t row : rows) {
        if (from == plan_.rank) add_block(sent[to], p, row);
        if (to == plan_.rank) add_block(received[from], p, row);
      }
    }
    for (int rank = 0; rank < ranks; ++rank) {
      sent[rank].rank = received[rank].rank = rank;
      if (!sent[rank].columns.empty()) plan_.sent.push_back(std::move(sent[rank]));
      if (!received[rank].columns.empty()) plan_.received.push_back(std::move(received[rank]));
    }
  }

 private:
  std::int32_t find_local(std::int32_t index) const { return local_of_position_[interface_.position[index]]; }

  /// The parent is interface supernode `above`: a front of this rank or another's.
  void set_parent(Front& front, std::int32_t above, int tag) const {
    if (interface_.owner[above] == plan_.rank) {
      front.parent = front_of_[above];
    } else {
      front.parent = -1;
      front.to_parent = {interface_.owner[above], tag, {}};
    }
  }

  void add_remote_child(std::int32_t above, int rank, int tag, const std::int32_t* begin, const std::int32_t* end) {
    if (interface_.owner[above] != plan_.rank || rank == plan_.rank) return;
    Edge edge{rank, tag, {}};
    for (; begin != end; ++begin) edge.rows.push_back(local_of_position_[*begin]);
    plan_.fronts[front_of_[above]].remote_children.push_back(std::move(edge));
  }

  void add_block(BlockList& list, std::int32_t column, std::int32_t row) const {
    list.columns.push_back(local_of_position_[column]);
    list.rows.push_back(local_of_position_[row]);
  }

  Plan& plan_;
  const NodeLinks& nodes_;
  const Interface& interface_;
  Ints touched_;
  Ints local_of_position_;
  Ints front_of_;
};

/// Plays the factorisation through: stacks, peak of memory, entries and flops of this rank.
Analysis::Rank measure(Plan& plan) {
  Analysis::Rank own;
  std::int64_t factor = 0;
  std::int64_t loose = 0;  // update matrices outside the stacks; those on their way to others may stay to the end
  std::int64_t interior_loose = 0;
  std::int64_t loose_peak = 0;
  std::int64_t scratch = 0;
  std::int64_t columns = 0;
  std::int64_t used[2] = {0, 0};
  const auto count = [](const Ints& rows) { return count_update(3 * static_cast<std::int64_t>(rows.size())); };
  for (const Front& front : plan.fronts) {
    own.entries += count_entries(front.width, front.size());
    own.flops += count_flops(front.width, front.size());
    factor += count_stored(front.width, front.size());
    scratch = std::max(scratch, count_wide(front));
    columns = std::max(columns, std::int64_t{9} * front.size() * front.width);
    const bool is_stacked = front.parent >= 0 && front.parent < plan.interior_fronts;
    std::int64_t& room = is_stacked ? used[front.depth % 2] : loose;
    room += count(front.rows);
    std::int64_t remote = 0;  // they come one after the other
    for (const Edge& edge : front.remote_children) remote = std::max(remote, count(edge.rows));
    loose_peak = std::max(loose_peak, loose + remote);
    if (!front.is_interface) interior_loose = std::max(interior_loose, loose);
    for (int parity = 0; parity < 2; ++parity) plan.stack_entries[parity] = std::max(plan.stack_entries[parity], used[parity]);
    for (const std::int32_t child : front.children)
      (front.is_interface ? loose : used[plan.fronts[child].depth % 2]) -= count(plan.fronts[child].rows);
  }
  const std::int64_t blocks = [&] {
    std::int64_t entries = 0;
    for (const auto* lists : {&plan.sent, &plan.received})
      for (const BlockList& list : *lists) entries += 9 * static_cast<std::int64_t>(list.columns.size());
    return entries;
  }();
  constexpr std::int64_t kSolveColumns = 32;
  // The stacks are given back before the first front of the interface.
  const std::int64_t updates = std::max(plan.stack_entries[0] + plan.stack_entries[1] + interior_loose, loose_peak);
  own.peak_bytes = 8 * (factor + updates + columns + scratch + blocks + 3 * kSolveColumns * plan.local_nodes);
  return own;
}

void gather_analysis(Plan& plan, const Analysis::Rank& own, int ranks, const Interface& interface) {
  Analysis& all = plan.analysis;
  all.ranks.resize(ranks);
  MPI_Allgather(&own, sizeof own, MPI_BYTE, all.ranks.data(), sizeof own, MPI_BYTE, plan.comm);
  for (const Analysis::Rank& rank : all.ranks) {
    all.entries += rank.entries;
    all.flops += rank.flops;
    all.peak_bytes += rank.peak_bytes;
    all.largest_peak_bytes = std::max(all.largest_peak_bytes, rank.peak_bytes);
  }
  const auto fronts = static_cast<std::int64_t>(plan.fronts.size());
  MPI_Allreduce(&fronts, &all.supernodes, 1, MPI_INT64_T, MPI_SUM, plan.comm);
  all.interface_nodes = interface.count();
}

}  // namespace

std::int64_t count_stored(std::int32_t width, std::int32_t size) {
  std::int64_t stored = 0;
  for (std::int32_t p = 0; p < count_panels(width); ++p) {
    const std::int64_t end = find_panel_start(width, p + 1);
    const std::int64_t nodes = end - find_panel_start(width, p);
    stored += count_triangle(3 * nodes) + 9 * nodes * (size - end);
  }
  return stored;
}

std::int64_t count_wide(const Front& front) {
  const std::int64_t panel = std::min(front.width, kPanelNodes);
  return 3 * panel * (3 * static_cast<std::int64_t>(front.size()) + kWideRows);
}

Plan make_plan(Mat stiffness, Mat mass) {
  Plan plan;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(stiffness), &plan.comm));
  MPI_Comm_rank(plan.comm, &plan.rank);
  int ranks = 1;
  MPI_Comm_size(plan.comm, &ranks);
  Ints rank_starts;
  NodeLinks nodes;
  petsc::run_agreed(plan.comm, [&] {
    const LocalRows k(stiffness);
    const LocalRows m(mass);
    if (k.rows() % 3 != 0 || k.first_row() % 3 != 0)
      throw InputError("K of a factorisation must have whole nodes of three rows on each rank.");
    nodes = find_links(k, m);
    const PetscInt* starts = nullptr;
    check(MatGetOwnershipRanges(stiffness, &starts));
    for (int rank = 0; rank <= ranks; ++rank) rank_starts.push_back(starts[rank] / 3);
  });
  std::vector<bool> is_interface;
  Interface interface = gather_interface(plan.comm, nodes, rank_starts, is_interface);
  Interior interior;
  petsc::run_agreed(plan.comm, [&] { interior = plan_interior(nodes, interface, is_interface); });
  const Ints first_positions = interior.boundary;
  plan_common(plan.comm, interior, interface);
  Analysis::Rank own;
  petsc::run_agreed(plan.comm, [&] {
    Ints boundary = first_positions;
    for (std::int32_t& position : boundary) position = interface.forest.position[position];
    PlanMaker maker(plan, nodes, interface);
    maker.number_nodes(interior);
    maker.add_interior_fronts(interior, boundary);
    maker.add_interface_fronts();
    maker.add_meetings(ranks);
    maker.add_blocks(ranks);
    plan.node_of_ghost_k = maker.find_ghosts(LocalRows(stiffness));
    plan.node_of_ghost_m = maker.find_ghosts(LocalRows(mass));
    own = measure(plan);
  });
  gather_analysis(plan, own, ranks, interface);
  return plan;
}

}  // namespace carillon::ldlt

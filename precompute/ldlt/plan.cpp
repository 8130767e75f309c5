// Method:     Each rank orders its subdomain by METIS and eliminates it on paper; what the roots of its forest leave on the separator is
//             gathered, and every rank plans the separator alike (separator.cpp). Whatever two ranks have to agree upon follows from that
//             common knowledge, so no message is spent on the messages to come.
// Source:     Duff and Reid 1983; Liu 1992, The multifrontal method for sparse matrix solution: theory and practice (stack of update
//             matrices).
// Deviations: two stacks, for fronts of even and odd depth: a front and its children never share one, so an update matrix can be made while
//             those of the children are read, and nothing has to be moved.
#include "precompute/ldlt/plan.hpp"

#include <algorithm>
#include <numeric>

#include "precompute/la/node_rows.hpp"
#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/separator.hpp"
#include "precompute/ldlt/subdomain.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::ldlt {
namespace {

using petsc::check;

bool leaves_rows(const Supernode& node) { return node.parent < 0 && !node.rows.empty(); }

/// Sends the rows of the subdomain's roots to everybody and plans the separator. Collective.
void plan_common(MPI_Comm comm, const Subdomain& subdomain, Separator& separator) {
  const auto count = static_cast<std::int32_t>(subdomain.own_node.size());
  Ragged roots;
  double entries = 0;
  for (const Supernode& node : subdomain.forest.supernodes) {
    entries += static_cast<double>(count_entries(node.width, node.size()));
    if (!leaves_rows(node)) continue;
    for (const std::int32_t row : node.rows) roots.items.push_back(subdomain.boundary[row - count]);
    roots.close();
  }
  Ints first_of_rank;
  separator.elements = gather_ragged(comm, roots, first_of_rank);
  for (std::size_t rank = 0; rank + 1 < first_of_rank.size(); ++rank)
    separator.element_rank.insert(separator.element_rank.end(), static_cast<std::size_t>(first_of_rank[rank + 1] - first_of_rank[rank]),
                                  static_cast<std::int32_t>(rank));
  std::vector<double> kept(first_of_rank.size() - 1);
  MPI_Allgather(&entries, 1, MPI_DOUBLE, kept.data(), 1, MPI_DOUBLE, comm);
  comm::Communicator(comm).agree([&] { plan_separator(separator, std::move(kept)); });
}

/// Makes a rank's own plan of the common one.
class PlanMaker {
 public:
  PlanMaker(Plan& plan, const NodeLinks& nodes, const Separator& separator) : plan_(plan), nodes_(nodes), separator_(separator) {}

  void number_nodes(const Subdomain& subdomain) {
    plan_.own_nodes = nodes_.own_nodes;
    plan_.subdomain_nodes = static_cast<std::int32_t>(subdomain.own_node.size());
    plan_.subdomain_fronts = static_cast<std::int32_t>(subdomain.forest.supernodes.size());
    front_of_.assign(separator_.owner.size(), -1);
    std::int32_t next = plan_.subdomain_fronts;
    for (std::size_t s = 0; s < front_of_.size(); ++s)
      if (separator_.owner[s] == plan_.rank) front_of_[s] = next++;
    touched_ = find_touched_positions(separator_, plan_.rank);
    local_of_position_.assign(separator_.nodes.size(), -1);
    for (std::size_t k = 0; k < touched_.size(); ++k)
      local_of_position_[touched_[k]] = plan_.subdomain_nodes + static_cast<std::int32_t>(k);
    plan_.local_nodes = plan_.subdomain_nodes + static_cast<std::int32_t>(touched_.size());
    plan_.node_of_own.assign(nodes_.own_nodes, -1);
    for (std::int32_t i = 0; i < plan_.subdomain_nodes; ++i) plan_.node_of_own[subdomain.own_node[i]] = i;
    for (std::int32_t i = separator_.first_of_rank[plan_.rank]; i < separator_.first_of_rank[plan_.rank + 1]; ++i)
      plan_.node_of_own[separator_.nodes[i] - nodes_.first_node] = find_local(i);
  }

  Ints find_ghosts(const NodeRows& rows) const {
    Ints local;
    for (PetscInt g = 0; g < rows.ghost_count(); ++g) {
      const std::int32_t index = separator_.find(rows.ghosts()[g] / 3);
      local.push_back(index < 0 ? -1 : find_local(index));
    }
    return local;
  }

  void add_subdomain_fronts(Subdomain& subdomain, const Ints& boundary_positions) {
    const Ints& element_rank = separator_.element_rank;
    auto element = static_cast<std::int32_t>(std::lower_bound(element_rank.begin(), element_rank.end(), plan_.rank) - element_rank.begin());
    for (Supernode& node : subdomain.forest.supernodes) {
      Front front;
      const bool leaves = leaves_rows(node);
      static_cast<Supernode&>(front) = std::move(node);
      for (std::int32_t& row : front.rows)
        if (row >= plan_.subdomain_nodes) row = local_of_position_[boundary_positions[row - plan_.subdomain_nodes]];
      if (leaves) {
        set_parent(front, separator_.forest.element_parents[element], element);
        ++element;
      }
      plan_.fronts.push_back(std::move(front));
    }
    for (std::int32_t s = plan_.subdomain_fronts; s-- > 0;) {
      Front& front = plan_.fronts[s];
      if (front.parent >= 0 && front.parent < plan_.subdomain_fronts) front.depth = plan_.fronts[front.parent].depth + 1;
    }
  }

  void add_separator_fronts() {
    const std::vector<Supernode>& supernodes = separator_.forest.supernodes;
    for (std::size_t s = 0; s < supernodes.size(); ++s) {
      if (separator_.owner[s] != plan_.rank) continue;
      Front front;
      front.is_separator = true;
      front.first = local_of_position_[supernodes[s].first];
      front.width = supernodes[s].width;
      for (const std::int32_t row : supernodes[s].rows) front.rows.push_back(local_of_position_[row]);
      if (supernodes[s].parent >= 0) set_parent(front, supernodes[s].parent, separator_.elements.count() + static_cast<std::int32_t>(s));
      plan_.fronts.push_back(std::move(front));
    }
    for (std::int32_t h = 0; h < separator_.elements.count(); ++h)
      if (separator_.forest.element_parents[h] >= 0)
        add_remote_child(separator_.forest.element_parents[h], separator_.element_rank[h], h, separator_.elements.begin(h),
                         separator_.elements.end(h));
    for (std::size_t s = 0; s < supernodes.size(); ++s)
      if (supernodes[s].parent >= 0)
        add_remote_child(supernodes[s].parent, separator_.owner[s], separator_.elements.count() + static_cast<std::int32_t>(s),
                         supernodes[s].rows.data(), supernodes[s].rows.data() + supernodes[s].rows.size());
    for (std::size_t s = 0; s < plan_.fronts.size(); ++s)
      if (plan_.fronts[s].parent >= 0) plan_.fronts[plan_.fronts[s].parent].children.push_back(static_cast<std::int32_t>(s));
  }

  void add_exchanges(int ranks) {
    const std::vector<Supernode>& supernodes = separator_.forest.supernodes;
    std::vector<SolveExchange> exchanges(supernodes.size());
    for (int rank = 0; rank < ranks; ++rank) {
      const Ints touched = rank == plan_.rank ? touched_ : find_touched_positions(separator_, rank);
      auto at = touched.begin();
      for (std::size_t s = 0; s < supernodes.size(); ++s) {
        const auto begin = at;
        at = std::lower_bound(at, touched.end(), supernodes[s].first + supernodes[s].width);
        const bool is_mine = separator_.owner[s] == plan_.rank;
        if (begin == at || rank == separator_.owner[s] || !(is_mine || rank == plan_.rank)) continue;
        Ints nodes;
        for (auto p = begin; p != at; ++p) nodes.push_back(local_of_position_[*p]);
        if (is_mine)
          exchanges[s].participants.push_back({rank, std::move(nodes)});
        else
          exchanges[s].nodes = std::move(nodes);
      }
    }
    for (std::size_t s = 0; s < supernodes.size(); ++s) {
      exchanges[s].owner = separator_.owner[s];
      exchanges[s].tag = static_cast<int>(s);
      exchanges[s].front = front_of_[s];
      if (exchanges[s].front >= 0 || !exchanges[s].nodes.empty()) plan_.exchanges.push_back(std::move(exchanges[s]));
    }
  }

  void add_blocks(int ranks) {
    std::vector<BlockList> sent(ranks);
    std::vector<BlockList> received(ranks);
    std::size_t s = 0;
    for (std::int32_t p = 0; p < separator_.count(); ++p) {
      while (p >= separator_.forest.supernodes[s].first + separator_.forest.supernodes[s].width) ++s;
      const std::int32_t i = separator_.index[p];
      const int from = find_rank(separator_.first_of_rank, i);
      const int to = separator_.owner[s];
      if (from != plan_.rank && to != plan_.rank) continue;
      Ints rows{p};
      for (const std::int32_t* j = separator_.links.begin(i); j != separator_.links.end(i); ++j)
        if (separator_.position[*j] > p) rows.push_back(separator_.position[*j]);
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
  std::int32_t find_local(std::int32_t index) const { return local_of_position_[separator_.position[index]]; }

  /// The parent is separator supernode `above`: a front of this rank or another's.
  void set_parent(Front& front, std::int32_t above, int tag) const {
    if (separator_.owner[above] == plan_.rank) {
      front.parent = front_of_[above];
    } else {
      front.parent = -1;
      front.to_parent = {separator_.owner[above], tag, {}};
    }
  }

  void add_remote_child(std::int32_t above, int rank, int tag, const std::int32_t* begin, const std::int32_t* end) {
    if (separator_.owner[above] != plan_.rank || rank == plan_.rank) return;
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
  const Separator& separator_;
  Ints touched_;
  Ints local_of_position_;
  Ints front_of_;
};

/// Plays the factorisation through: stacks, peak of memory, entries and flops of this rank.
Analysis::Rank measure(Plan& plan) {
  Analysis::Rank own;
  std::int64_t factor = 0;
  std::int64_t loose = 0;  // update matrices outside the stacks; those on their way to others may stay to the end
  std::int64_t subdomain_loose = 0;
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
    const bool is_stacked = front.parent >= 0 && front.parent < plan.subdomain_fronts;
    std::int64_t& room = is_stacked ? used[front.depth % 2] : loose;
    room += count(front.rows);
    std::int64_t remote = 0;  // they come one after the other
    for (const Edge& edge : front.remote_children) remote = std::max(remote, count(edge.rows));
    loose_peak = std::max(loose_peak, loose + remote);
    if (!front.is_separator) subdomain_loose = std::max(subdomain_loose, loose);
    for (int parity = 0; parity < 2; ++parity) plan.stack_entries[parity] = std::max(plan.stack_entries[parity], used[parity]);
    for (const std::int32_t child : front.children)
      (front.is_separator ? loose : used[plan.fronts[child].depth % 2]) -= count(plan.fronts[child].rows);
  }
  const std::int64_t blocks = [&] {
    std::int64_t entries = 0;
    for (const auto* lists : {&plan.sent, &plan.received})
      for (const BlockList& list : *lists) entries += 9 * static_cast<std::int64_t>(list.columns.size());
    return entries;
  }();
  constexpr std::int64_t kSolveColumns = 32;
  // The stacks are given back before the first front of the separator.
  const std::int64_t updates = std::max(plan.stack_entries[0] + plan.stack_entries[1] + subdomain_loose, loose_peak);
  own.peak_bytes = 8 * (factor + updates + columns + scratch + blocks + 3 * kSolveColumns * plan.local_nodes);
  return own;
}

void gather_analysis(Plan& plan, const Analysis::Rank& own, int ranks, const Separator& separator) {
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
  all.separator_nodes = separator.count();
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
  const comm::Communicator comm = petsc::get_communicator(stiffness);
  plan.comm = comm;
  plan.rank = comm.rank();
  const int ranks = comm.size();
  Ints rank_starts;
  NodeLinks nodes;
  comm.agree([&] {
    const NodeRows k(stiffness);
    const NodeRows m(mass);
    if (k.rows() % 3 != 0 || k.first_row() % 3 != 0)
      throw InputError("K of a factorisation must have whole nodes of three rows on each rank.");
    nodes = find_links(k, m);
    const PetscInt* starts = nullptr;
    check(MatGetOwnershipRanges(stiffness, &starts));
    for (int rank = 0; rank <= ranks; ++rank) rank_starts.push_back(starts[rank] / 3);
  });
  std::vector<bool> is_separator;
  Separator separator = gather_separator(plan.comm, nodes, rank_starts, is_separator);
  Subdomain subdomain;
  comm::Communicator(plan.comm).agree([&] { subdomain = plan_subdomain(nodes, separator, is_separator); });
  const Ints first_positions = subdomain.boundary;
  plan_common(plan.comm, subdomain, separator);
  Analysis::Rank own;
  comm::Communicator(plan.comm).agree([&] {
    Ints boundary = first_positions;
    for (std::int32_t& position : boundary) position = separator.forest.position[position];
    PlanMaker maker(plan, nodes, separator);
    maker.number_nodes(subdomain);
    maker.add_subdomain_fronts(subdomain, boundary);
    maker.add_separator_fronts();
    maker.add_exchanges(ranks);
    maker.add_blocks(ranks);
    plan.node_of_ghost_k = maker.find_ghosts(NodeRows(stiffness));
    plan.node_of_ghost_m = maker.find_ghosts(NodeRows(mass));
    own = measure(plan);
  });
  gather_analysis(plan, own, ranks, separator);
  return plan;
}

}  // namespace carillon::ldlt

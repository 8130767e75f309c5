// Method: Multifrontal L D L^T. A front holds its pivot columns (f, w) and a contribution block (r, r) for the remaining rows; entries of A
// and the contribution blocks of the children are added, panels of at most 72 columns are eliminated in turn, and the contribution block
// goes to the parent. In a panel the diagonal block is factorised with pivoting (P A11 P^T = L11 D L11^T), L11^-1 is stored instead of L11,
// and W = A21 P^T L11^-T = L21 D, L21 = W D^-1, A22 -= L21 W^T are products of tiles and strips. There are no delayed pivots: a bad pivot
// shows in the backward error, which is reported to the caller.
// Source: Duff and Reid 1983; Liu 1992; Schenk and Gaertner 2006 (pivots within the diagonal block only). Explicit inverse: Higham 2002,
// Accuracy and stability of numerical algorithms, chapter 14 (with rook pivoting L11 has entries of order one).
#include "precompute/ldlt/numeric.hpp"

#include <algorithm>
#include <numeric>

#include "precompute/la/node_rows.hpp"
#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/shared.hpp"
#include "precompute/ldlt/storage.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::ldlt {
namespace {

using la::NodeRows;

static_assert(3 * kPanelNodes <= kMaxBlock);

/// Panels fit into the columns that they replace (kColumnsBegin): a triangle takes no more than its square.
constexpr bool fit_triangles() {
  for (std::int64_t n = 3; n <= 3 * kPanelNodes; n += 3)
    if (count_triangle(n) > std::min(n * n, kColumnsBegin)) return false;
  return true;
}
static_assert(fit_triangles());

class Factoriser {
 public:
  Factoriser(const Plan& plan, const la::Pencil& pencil, double sigma, Numbers& numbers)
      : plan_(plan),
        k_(pencil.stiffness),
        m_(pencil.mass),
        k_factor_(pencil.stiffness_factor),
        m_factor_(-sigma * pencil.mass_factor),
        numbers_(numbers),
        kernels_(find_factor_kernels()),
        shared_(plan, numbers, received_) {
    std::int64_t scratch = 0;
    for (const Front& front : plan.fronts) scratch = std::max(scratch, count_wide(front.width, front.size()));
    numbers.panels.populate();
    wide_ = Buffer(scratch);
    block_ = Buffer(kMaxBlock * kMaxBlock);
    for (int parity = 0; parity < 2; ++parity) top_[parity] = numbers.panels.data() + plan.room.stack_begin[parity];
    where_.assign(plan.local_nodes, -1);
    slot_.assign(plan.node_of_link.size(), -1);
    requests_.reserve(plan.received.size() + plan.sent.size());
    for (const SentBlocks& list : plan.sent) sent_.emplace_back(9 * list.columns.size());
    for (const ReceivedBlocks& list : plan.received) received_.emplace_back(9 * list.count());
    block_at_.assign(plan.received.size(), 0);
  }

  /// Collective.
  void run() {
    exchange_blocks();
    shared_.run([&] {
      for (std::int32_t s = 0; s < static_cast<std::int32_t>(plan_.fronts.size()); ++s) process(s);
      wide_ = Buffer();
      numbers_.panels.lend_tail(plan_.room.panels);
    });
  }

 private:
  void process(std::int32_t s) {
    const Front& front = plan_.fronts[s];
    w_ = 3 * front.width;
    r_ = 3 * static_cast<int>(front.rows.size());
    f_ = w_ + r_;
    update_ = top_[front.depth % 2] -= count_update(r_);
    double* panels = numbers_.panels.data() + numbers_.front_offsets[s];
    columns_ = panels + kColumnsBegin;
    point_at_columns();
    for (std::int32_t i = 0; i < front.width; ++i) where_[front.first + i] = i;
    for (std::size_t i = 0; i < front.rows.size(); ++i) where_[front.rows[i]] = front.width + static_cast<std::int32_t>(i);
    std::fill_n(columns_, static_cast<std::size_t>(f_) * static_cast<std::size_t>(w_), 0.0);
    // The first panel initialises the contribution block, so it is not cleared; the children are added to it afterwards.
    add_entries(front);
    add_blocks(front);
    double* const top[2] = {top_[0], top_[1]};
    for (std::size_t c = front.children.size(); c-- > 0;) add_child(front.children[c], Part::kPivots);  // last child is on top of the stack
    std::copy(top, top + 2, top_);
    eliminate(front, panels);
    for (std::size_t c = front.children.size(); c-- > 0;) add_child(front.children[c], Part::kRest);
    if (front.parent >= 0) return;
    if (front.shared_parent >= 0)
      shared_.send_update(front.shared_parent, front.place_in_parent, 0,
                          [this](std::int32_t a, std::int64_t c) { return update_ + find_update_column(r_, c) + std::int64_t{3} * a; });
    top_[front.depth % 2] += count_update(r_);
  }

  /// starts_: address of row 0 of each column of the front.
  void point_at_columns() {
    starts_.resize(f_);
    for (int c = 0; c < w_; ++c) starts_[c] = columns_ + static_cast<std::ptrdiff_t>(c) * f_;
    for (int c = w_; c < f_; ++c) starts_[c] = update_ + find_update_column(r_, c - w_) - w_;
  }

  /// Adds factor times row 3 v + d of a matrix to column `target` of the front; `first`: first pivot of the front.
  void add_row(const NodeRows& rows, const Ints& ghosts, PetscInt row, std::int32_t first, double factor, double* target) const {
    const auto add = [&](std::int32_t node, PetscInt column, double value) {
      if (node >= first) target[3 * where_[node] + column % 3] += factor * value;
    };
    rows.visit(
        row, [&](PetscInt column, double value) { add(plan_.node_of_link[column / 3], column, value); },
        [&](PetscInt ghost, double value) { add(plan_.node_of_link[ghosts[ghost]], rows.ghosts()[ghost], value); });
  }

  void add_entries(const Front& front) {
    for (std::int32_t i = 0; i < front.width; ++i) {
      double* target = columns_ + static_cast<std::ptrdiff_t>(3 * i) * f_;
      const std::int32_t own = plan_.own_of_pivot[front.first + i];
      if (own < 0) continue;  // handled by add_blocks
      if (k_.has_blocks())
        add_node_rows(own, front.first, target);
      else
        for (int d = 0; d < 3; ++d) add_row(k_, plan_.link_of_ghost_k, 3 * own + d, front.first, k_factor_, target + d * f_);
      for (int d = 0; d < 3; ++d) add_row(m_, plan_.link_of_ghost_m, 3 * own + d, front.first, m_factor_, target + d * f_);
    }
  }

  /// Adds the rows of K of a node, stored as 3x3 blocks, to three columns of the front.
  void add_node_rows(std::int32_t own, std::int32_t first, double* target) const {
    const auto add = [&](std::int32_t node, const double* const(&values)[3]) {
      if (node < first) return;
      double* to = target + 3 * where_[node];
      for (int d = 0; d < 3; ++d)
        for (int e = 0; e < 3; ++e) to[d * f_ + e] += k_factor_ * values[d][e];
    };
    k_.visit_blocks(
        own, [&](PetscInt column, const double* const(&values)[3]) { add(plan_.node_of_link[column / 3], values); },
        [&](PetscInt ghost, const double* const(&values)[3]) { add(plan_.node_of_link[plan_.link_of_ghost_k[ghost]], values); });
  }

  /// Sends the 3x3 blocks that other ranks eliminate, and those of shared fronts.
  void exchange_blocks() {
    for (std::size_t l = 0; l < plan_.sent.size(); ++l) {
      const SentBlocks& list = plan_.sent[l];
      std::fill(sent_[l].begin(), sent_[l].end(), 0.0);
      for (std::size_t begin = 0; begin < list.columns.size();) {
        std::size_t end = begin;
        for (; end < list.columns.size() && list.columns[end] == list.columns[begin]; ++end)
          slot_[list.rows[end]] = static_cast<std::int32_t>(end);
        collect_blocks(list.columns[begin], sent_[l]);
        for (std::size_t i = begin; i < end; ++i) slot_[list.rows[i]] = -1;
        begin = end;
      }
    }
    for (std::size_t l = 0; l < plan_.received.size(); ++l)
      if (plan_.received[l].rank != plan_.rank)
        MPI_Irecv(received_[l].data(), static_cast<int>(received_[l].size()), MPI_DOUBLE, plan_.received[l].rank, kBlockTag, plan_.comm,
                  &requests_.emplace_back());
    for (std::size_t l = 0; l < plan_.sent.size(); ++l) {
      if (plan_.sent[l].rank != plan_.rank) {
        MPI_Isend(sent_[l].data(), static_cast<int>(sent_[l].size()), MPI_DOUBLE, plan_.sent[l].rank, kBlockTag, plan_.comm,
                  &requests_.emplace_back());
        continue;
      }
      for (std::size_t k = 0; k < plan_.received.size(); ++k)
        if (plan_.received[k].rank == plan_.rank) received_[k].swap(sent_[l]);
    }
    MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
    sent_.clear();
  }

  void collect_blocks(std::int32_t own, std::vector<double>& blocks) const {
    for (int d = 0; d < 3; ++d) {
      const auto collect = [&](const NodeRows& rows, const Ints& ghosts, double factor) {
        const auto add = [&](std::int32_t link, PetscInt column, double value) {
          const std::int32_t at = slot_[link];
          if (at >= 0) blocks[std::ptrdiff_t{9} * at + 3 * d + column % 3] += factor * value;
        };
        rows.visit(
            3 * own + d, [&](PetscInt column, double value) { add(column / 3, column, value); },
            [&](PetscInt ghost, double value) { add(ghosts[ghost], rows.ghosts()[ghost], value); });
      };
      collect(k_, plan_.link_of_ghost_k, k_factor_);
      collect(m_, plan_.link_of_ghost_m, m_factor_);
    }
  }

  /// Adds the blocks received from other ranks; fronts and blocks are in the same order.
  void add_blocks(const Front& front) {
    for (std::size_t l = 0; l < plan_.received.size(); ++l) {
      const ReceivedBlocks& list = plan_.received[l];
      std::size_t& at = block_at_[l];
      for (; at < list.columns.size() && list.columns[at] < front.first + front.width; ++at)
        for (int d = 0; d < 3; ++d)
          for (int e = 0; e < 3; ++e)
            columns_[static_cast<std::ptrdiff_t>(3 * where_[list.columns[at]] + d) * f_ + 3 * where_[list.rows[at]] + e] +=
                received_[l][9 * at + static_cast<std::size_t>(3 * d + e)];
    }
  }

  /// Locates the rows of a child in the front, as runs; pivots come first. Returns the number of nodes among the pivots.
  std::size_t locate(const Ints& rows, std::int32_t pivots) {
    runs_.clear();
    node_runs_.clear();
    std::size_t before = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const int to = 3 * where_[rows[i]];
      if (where_[rows[i]] < pivots) ++before;
      if (runs_.empty() || runs_.back().to + runs_.back().length != to) runs_.push_back({3 * static_cast<int>(i), to, 0});
      runs_.back().length += 3;
      node_runs_.push_back(static_cast<int>(runs_.size()) - 1);
    }
    return before;
  }

  /// Adds the columns of node j of a child's contribution block of r rows, from their diagonals on.
  void add_node(const double* update, std::int64_t r, std::size_t j) {
    const int k = node_runs_[j];
    const RowRun whole = runs_[k];
    const int from = 3 * static_cast<int>(j);
    const int column = whole.to + from - whole.from;
    const double* source[3];
    for (int c = 0; c < 3; ++c) source[c] = update + find_update_column(r, from + c);
    runs_[k] = {from, column, whole.length - (from - whole.from)};
    kernels_.extend_add(source, runs_.data() + k, static_cast<int>(runs_.size()) - k, starts_.data() + column);
    runs_[k] = whole;
  }

  enum class Part { kPivots, kRest };

  /// Adds the part of a child's contribution block in the pivot columns, or the rest of it, and pops it from its stack. Children are
  /// stacked in order, so the last one is taken first.
  void add_child(std::int32_t s, Part part) {
    const Front& child = plan_.fronts[s];
    const std::size_t pivots = locate(child.rows, w_ / 3);
    const std::int64_t r = 3 * static_cast<std::int64_t>(child.rows.size());
    const double* source = top_[child.depth % 2];
    top_[child.depth % 2] += count_update(r);
    for (std::size_t j = part == Part::kRest ? pivots : 0; j < (part == Part::kPivots ? pivots : child.rows.size()); ++j)
      add_node(source, r, j);
  }

  void eliminate(const Front& front, double* panels) {
    for (std::int32_t p = 0; p < count_panels(front.width); ++p) {
      const int begin = 3 * find_panel_start(front.width, p);
      const int end = 3 * find_panel_start(front.width, p + 1);
      panels = eliminate_panel(3 * front.first, begin, end, p == 0, panels);
    }
  }

  double* eliminate_panel(std::size_t first_row, int begin, int end, bool is_made, double* triangle) {
    const int n = end - begin;
    double* tiles = triangle + count_triangle(n);
    BlockPivots pivots;
    factorise_diagonal(begin, n, pivots, triangle);
    first_row += static_cast<std::size_t>(begin);
    std::copy(pivots.diagonal, pivots.diagonal + n, numbers_.d_diagonal.data() + first_row);
    std::copy(pivots.off, pivots.off + n, numbers_.d_off.data() + first_row);
    std::copy(pivots.order, pivots.order + n, numbers_.order.data() + first_row);
    if (end == f_) return tiles;
    const double* columns[kMaxBlock];
    for (int k = 0; k < n; ++k) columns[k] = starts_[begin + pivots.order[k]];
    kernels_.trsm(columns, end, f_, n, triangle, wide_.data());
    kernels_.scale_by_d_inverse(wide_.data(), 0, f_ - end, n, pivots, tiles, numbers_.outcome.growth);
    kernels_.update({tiles, wide_.data(), n, end}, w_, f_, is_made, starts_.data());
    return tiles + static_cast<std::ptrdiff_t>(f_ - end) * n;
  }

  void factorise_diagonal(int begin, int n, BlockPivots& pivots, double* triangle) {
    double* block = block_.data();
    for (int j = 0; j < n; ++j)
      for (int i = j; i < n; ++i) block[j * kMaxBlock + i] = block[i * kMaxBlock + j] = starts_[begin + j][begin + i];
    numbers_.outcome.eliminate(kernels_, block, n, pivots, triangle);
  }

  static constexpr int kBlockTag = 1;

  const Plan& plan_;
  NodeRows k_;
  NodeRows m_;
  double k_factor_;  // of K and M: a and -sigma b of A = a K - sigma b M
  double m_factor_;
  Numbers& numbers_;
  const FactorKernels& kernels_;

  // Current front: w pivot columns of f rows, and the contribution block of the r other rows.
  int w_ = 0, r_ = 0, f_ = 0;
  double* columns_ = nullptr;
  Buffer wide_;
  Buffer block_;
  double* update_ = nullptr;
  std::vector<double*> starts_;
  Ints where_;                // (local_nodes) node of the current front
  std::vector<RowRun> runs_;  // of the child being added
  Ints node_runs_;            // run of each of its nodes

  double* top_[2] = {nullptr, nullptr};  // of the stacks of contribution blocks, which grow downwards
  Ints slot_;                            // (own nodes and ghosts) block of the column being sent, -1
  std::vector<MPI_Request> requests_;
  std::vector<std::vector<double>> sent_;
  std::vector<std::vector<double>> received_;
  std::vector<std::size_t> block_at_;
  SharedFactoriser shared_;
};

}  // namespace

void Outcome::eliminate(const FactorKernels& kernels, double* block, int n, BlockPivots& pivots, double* triangle) {
  if (kernels.factorise_block(block, n, pivots, triangle)) {
    negative += pivots.negative;
    smallest = std::min(smallest, pivots.smallest);
    return;
  }
  is_complete = false;
  std::fill(triangle, triangle + count_triangle(n), 0.0);
  std::fill(pivots.diagonal, pivots.diagonal + n, 0.0);
  std::fill(pivots.off, pivots.off + n, 0.0);
  std::iota(pivots.order, pivots.order + n, 0);
}

Numbers make_numbers(const Plan& plan) {
  Numbers numbers;
  std::int64_t stored = 0;
  for (const Front& front : plan.fronts) {
    numbers.front_offsets.push_back(stored);
    stored += count_stored(front.width, front.size());
  }
  std::int32_t pivots = plan.pivot_nodes;
  for (const SharedFront& front : plan.shared) {
    std::vector<SharedPanel>& panels = numbers.shared.emplace_back();
    numbers.shared_columns.push_back(stored + kColumnsBegin);
    for (int k = 0; k < front.map.pivot_tiles(); ++k) {
      SharedPanel& panel = panels.emplace_back();
      if (!front.map.has_column(front.place, k)) continue;
      const std::int64_t n = 3 * std::int64_t{front.map.nodes(k)};
      if (front.map.owner(k, k) == front.place) {
        panel.pivots = 3 * pivots;
        pivots += front.map.nodes(k);
        panel.triangle = stored;
        stored += count_triangle(n);
      }
      panel.tiles = stored;
      stored += 3 * n * (front.own_nodes() - front.row_begin[k + 1]);
    }
    stored = numbers.shared_columns.back() + front.count_pivot_columns();  // panels fit into the columns that they replace
  }
  numbers.panels = Buffer(plan.room.numbers, Pages::kAtOnce);
  numbers.d_diagonal.assign(3 * pivots, 0.0);
  numbers.d_off.assign(3 * pivots, 0.0);
  numbers.order.assign(3 * pivots, 0);
  return numbers;
}

void factorise_fronts(const Plan& plan, const la::Pencil& pencil, double sigma, Numbers& numbers, Workspace& workspace) {
  ++numbers.generation;
  numbers.outcome = {};
  const comm::Communicator comm(plan.comm);
  {
    const BufferReuse reuse;
    workspace = {};
    std::unique_ptr<Factoriser> factoriser;
    comm.agree([&] { factoriser = std::make_unique<Factoriser>(plan, pencil, sigma, numbers); });
    factoriser->run();
  }
  comm.agree([&] { workspace = make_workspace(plan, numbers); });
}

}  // namespace carillon::ldlt

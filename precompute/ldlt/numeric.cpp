// Method:     Multifrontal L D L^T. A front holds its pivot columns (f, w) and an update matrix (r, r) for the rows behind them; entries of
//             A and the children's update matrices are added in, panels of at most 72 columns are eliminated one after the other, and the
//             update matrix goes to the parent. In a panel the diagonal block is factorised with pivoting (P A11 P^T = L11 D L11^T), L11^-1
//             is kept instead of L11, and W = A21 P^T L11^-T = L21 D, L21 = W D^-1, A22 -= L21 W^T are products of tiles with strips.
// Source:     Duff and Reid 1983; Liu 1992; Schenk and Gaertner 2006 (pivots are sought inside the diagonal block only). The explicit
//             inverse: Higham 2002, Accuracy and stability of numerical algorithms, chapter 14 (L11 has entries of order one by rook
//             pivoting).
// Deviations: no delayed pivots: a bad pivot shows in the backward error, which is reported to the caller.
#include "precompute/ldlt/numeric.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <numeric>

#include "precompute/la/node_rows.hpp"
#include "precompute/ldlt/kernels.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::ldlt {
namespace {

using la::NodeRows;

static_assert(3 * kPanelNodes <= kMaxBlock);

class Factoriser {
 public:
  Factoriser(const Plan& plan, const la::Pencil& pencil, double sigma, Numbers& numbers)
      : plan_(plan),
        k_(pencil.stiffness),
        m_(pencil.mass),
        k_factor_(pencil.stiffness_factor),
        m_factor_(-sigma * pencil.mass_factor),
        numbers_(numbers),
        kernels_(get_kernels()) {
    std::int64_t largest = 0;
    std::int64_t scratch = 0;
    for (const Front& front : plan.fronts) {
      largest = std::max(largest, std::int64_t{9} * front.size() * front.width);
      scratch = std::max(scratch, count_wide(front));
    }
    columns_ = Buffer(largest);
    wide_ = Buffer(scratch);
    block_ = Buffer(kMaxBlock * kMaxBlock);
    for (int parity = 0; parity < 2; ++parity) stack_[parity] = Buffer(plan.stack_entries[parity], Pages::kAtOnce);
    where_.assign(plan.local_nodes, -1);
    loose_.resize(plan.fronts.size());
    remote_.resize(plan.fronts.size());
    for (std::size_t s = 0; s < plan.fronts.size(); ++s) {
      const Front& front = plan.fronts[s];
      if (!is_stacked(front)) loose_[s] = Buffer(count_update(count_rows(front.rows)));
      for (const Edge& edge : front.remote_children) remote_[s].emplace_back(count_update(count_rows(edge.rows)));
    }
    for (const BlockList& list : plan.sent) sent_.emplace_back(9 * list.columns.size());
    for (const BlockList& list : plan.received) received_.emplace_back(9 * list.columns.size());
    own_of_local_.assign(plan.local_nodes, -1);
    for (std::int32_t v = 0; v < plan.own_nodes; ++v) own_of_local_[plan.node_of_own[v]] = v;
  }

  void run() {
    start_blocks();
    for (std::int32_t s = 0; s < plan_.subdomain_fronts; ++s) process(s);
    finish_blocks();
    for (Buffer& stack : stack_) stack = Buffer();
    for (std::int32_t s = plan_.subdomain_fronts; s < static_cast<std::int32_t>(plan_.fronts.size()); ++s) {
      release_sent();
      process(s);
    }
    MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
    reduce();
  }

 private:
  static std::int64_t count_rows(const Ints& nodes) { return 3 * static_cast<std::int64_t>(nodes.size()); }
  bool is_stacked(const Front& front) const { return front.parent >= 0 && front.parent < plan_.subdomain_fronts; }

  void process(std::int32_t s) {
    const Front& front = plan_.fronts[s];
    w_ = 3 * front.width;
    r_ = 3 * static_cast<int>(front.rows.size());
    f_ = w_ + r_;
    update_ = is_stacked(front) ? stack_[front.depth % 2].data() + used_[front.depth % 2] : loose_[s].data();
    if (is_stacked(front)) used_[front.depth % 2] += count_update(r_);
    point_at_columns();
    for (std::int32_t i = 0; i < front.width; ++i) where_[front.first + i] = i;
    for (std::size_t i = 0; i < front.rows.size(); ++i) where_[front.rows[i]] = front.width + static_cast<std::int32_t>(i);
    std::fill_n(columns_.data(), static_cast<std::size_t>(f_) * static_cast<std::size_t>(w_), 0.0);
    double* panels = numbers_.panels.data() + numbers_.front_offsets[s];
    if (front.is_separator) {
      std::fill_n(update_, count_update(r_), 0.0);  // none where nothing is updated
      add_blocks(front);
      for (std::size_t c = front.children.size(); c-- > 0;) add_child(front.children[c], Part::kAll);  // the last one lies on top
      for (std::size_t c = 0; c < front.remote_children.size(); ++c) add_remote_child(front.remote_children[c], remote_[s][c]);
      eliminate(front, false, panels);
    } else {
      // The first panel makes the update matrix, so it need not be cleared, and the children's shares in it come behind.
      add_entries(front);
      const std::int64_t used[2] = {used_[0], used_[1]};
      for (std::size_t c = front.children.size(); c-- > 0;) add_child(front.children[c], Part::kPivots);
      std::copy(used, used + 2, used_);
      eliminate(front, true, panels);
      for (std::size_t c = front.children.size(); c-- > 0;) add_child(front.children[c], Part::kRest);
    }
    if (front.to_parent.rank >= 0) send_update(front, s);
  }

  /// starts_: where row 0 of each column of the front would be.
  void point_at_columns() {
    starts_.resize(static_cast<std::size_t>(f_));
    for (int c = 0; c < w_; ++c) starts_[c] = columns_.data() + static_cast<std::ptrdiff_t>(c) * f_;
    for (int c = w_; c < f_; ++c) starts_[c] = update_ + find_update_column(r_, c - w_) - w_;
  }

  /// Adds factor times this rank's row 3 v + d of a matrix to column `target` of the front; `first`: its first pivot.
  void add_row(const NodeRows& rows, const Ints& ghosts, PetscInt row, std::int32_t first, double factor, double* target) const {
    const auto add = [&](std::int32_t node, PetscInt column, double value) {
      if (node >= first) target[3 * where_[node] + column % 3] += factor * value;
    };
    rows.visit(
        row, [&](PetscInt column, double value) { add(plan_.node_of_own[column / 3], column, value); },
        [&](PetscInt ghost, double value) { add(ghosts[ghost], rows.ghosts()[ghost], value); });
  }

  void add_entries(const Front& front) {
    for (std::int32_t i = 0; i < front.width; ++i) {
      double* target = columns_.data() + static_cast<std::ptrdiff_t>(3 * i) * f_;
      const std::int32_t own = own_of_local_[front.first + i];
      if (k_.has_blocks())
        add_node_rows(own, front.first, target);
      else
        for (int d = 0; d < 3; ++d) add_row(k_, plan_.node_of_ghost_k, 3 * own + d, front.first, k_factor_, target + d * f_);
      for (int d = 0; d < 3; ++d) add_row(m_, plan_.node_of_ghost_m, 3 * own + d, front.first, m_factor_, target + d * f_);
    }
  }

  /// Adds K's rows of a node, which are blocks of 3x3, to three columns of the front.
  void add_node_rows(std::int32_t own, std::int32_t first, double* target) const {
    const auto add = [&](std::int32_t node, const double* const(&values)[3]) {
      if (node < first) return;
      double* to = target + 3 * where_[node];
      for (int d = 0; d < 3; ++d)
        for (int e = 0; e < 3; ++e) to[d * f_ + e] += k_factor_ * values[d][e];
    };
    k_.visit_blocks(
        own, [&](PetscInt column, const double* const(&values)[3]) { add(plan_.node_of_own[column / 3], values); },
        [&](PetscInt ghost, const double* const(&values)[3]) { add(plan_.node_of_ghost_k[ghost], values); });
  }

  /// Collects the 3x3 blocks between separator nodes that this rank's rows hold, and sends them to the owners of their fronts.
  void start_blocks() {
    Ints slot(plan_.local_nodes, -1);
    for (std::size_t l = 0; l < plan_.sent.size(); ++l) {
      const BlockList& list = plan_.sent[l];
      std::fill(sent_[l].begin(), sent_[l].end(), 0.0);
      for (std::size_t begin = 0; begin < list.columns.size();) {
        std::size_t end = begin;
        for (; end < list.columns.size() && list.columns[end] == list.columns[begin]; ++end)
          slot[list.rows[end]] = static_cast<std::int32_t>(end);
        collect_blocks(own_of_local_[list.columns[begin]], slot, sent_[l]);
        for (std::size_t i = begin; i < end; ++i) slot[list.rows[i]] = -1;
        begin = end;
      }
    }
    for (std::size_t l = 0; l < plan_.received.size(); ++l)
      if (plan_.received[l].rank != plan_.rank)
        MPI_Irecv(received_[l].data(), static_cast<int>(received_[l].size()), MPI_DOUBLE, plan_.received[l].rank, kBlockTag, plan_.comm,
                  &block_requests_.emplace_back());
    for (std::size_t l = 0; l < plan_.sent.size(); ++l)
      if (plan_.sent[l].rank != plan_.rank)
        MPI_Isend(sent_[l].data(), static_cast<int>(sent_[l].size()), MPI_DOUBLE, plan_.sent[l].rank, kBlockTag, plan_.comm,
                  &block_requests_.emplace_back());
  }

  void collect_blocks(std::int32_t own, const Ints& slot, std::vector<double>& blocks) const {
    for (int d = 0; d < 3; ++d) {
      const auto collect = [&](const NodeRows& rows, const Ints& ghosts, double factor) {
        const auto add = [&](std::int32_t node, PetscInt column, double value) {
          if (node >= 0 && slot[node] >= 0)
            blocks[9 * static_cast<std::size_t>(slot[node]) + static_cast<std::size_t>(3 * d + column % 3)] += factor * value;
        };
        rows.visit(
            3 * own + d, [&](PetscInt column, double value) { add(plan_.node_of_own[column / 3], column, value); },
            [&](PetscInt ghost, double value) { add(ghosts[ghost], rows.ghosts()[ghost], value); });
      };
      collect(k_, plan_.node_of_ghost_k, k_factor_);
      collect(m_, plan_.node_of_ghost_m, m_factor_);
    }
  }

  void finish_blocks() {
    MPI_Waitall(static_cast<int>(block_requests_.size()), block_requests_.data(), MPI_STATUSES_IGNORE);
    for (std::size_t l = 0; l < plan_.received.size(); ++l)
      if (plan_.received[l].rank == plan_.rank)
        for (std::size_t k = 0; k < plan_.sent.size(); ++k)
          if (plan_.sent[k].rank == plan_.rank) received_[l].swap(sent_[k]);
    block_at_.assign(plan_.received.size(), 0);
  }

  /// Adds the blocks of a separator front; fronts and blocks are in the same order.
  void add_blocks(const Front& front) {
    for (std::size_t l = 0; l < plan_.received.size(); ++l) {
      const BlockList& list = plan_.received[l];
      std::size_t& at = block_at_[l];
      for (; at < list.columns.size() && list.columns[at] < front.first + front.width; ++at)
        for (int d = 0; d < 3; ++d)
          for (int e = 0; e < 3; ++e)
            columns_.data()[static_cast<std::ptrdiff_t>(3 * where_[list.columns[at]] + d) * f_ + 3 * where_[list.rows[at]] + e] +=
                received_[l][9 * at + static_cast<std::size_t>(3 * d + e)];
    }
  }

  /// Where a child's rows are in the front, as runs; the columns of pivots come first. Returns the number of nodes among the pivots.
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

  /// Adds the columns of node j of a child's update matrix of r rows, from their diagonals on.
  void add_node(const double* update, std::int64_t r, std::size_t j) {
    const int k = node_runs_[j];
    const Run whole = runs_[k];
    const int from = 3 * static_cast<int>(j);
    const int column = whole.to + from - whole.from;
    const double* source[3];
    for (int c = 0; c < 3; ++c) source[c] = update + find_update_column(r, from + c);
    runs_[k] = {from, column, whole.length - (from - whole.from)};
    kernels_.extend_add(source, runs_.data() + k, static_cast<int>(runs_.size()) - k, starts_.data() + column);
    runs_[k] = whole;
  }

  enum class Part { kPivots, kRest, kAll };

  /// Adds a child's update matrix, or what of it falls into the columns of pivots, or the rest of it; gives it back with the rest.
  void add_child(std::int32_t s, Part part) {
    const Front& child = plan_.fronts[s];
    const std::size_t pivots = locate(child.rows, w_ / 3);
    const std::int64_t r = count_rows(child.rows);
    const bool stacked = is_stacked(child);
    if (stacked) used_[child.depth % 2] -= count_update(r);
    const double* source = child_update(child, s);
    for (std::size_t j = part == Part::kRest ? pivots : 0; j < (part == Part::kPivots ? pivots : child.rows.size()); ++j)
      add_node(source, r, j);
    if (!stacked && part != Part::kPivots) loose_[s] = Buffer();
  }

  /// Children lie on their stack in order, and are taken from behind: so where they begin follows from what is used below them.
  const double* child_update(const Front& child, std::int32_t s) const {
    return is_stacked(child) ? stack_[child.depth % 2].data() + used_[child.depth % 2] : loose_[s].data();
  }

  void add_remote_child(const Edge& edge, Buffer& update) {
    MPI_Recv(update.data(), static_cast<int>(update.size()), MPI_DOUBLE, edge.rank, kUpdateTag + edge.tag, plan_.comm, MPI_STATUS_IGNORE);
    locate(edge.rows, 0);
    for (std::size_t j = 0; j < edge.rows.size(); ++j) add_node(update.data(), count_rows(edge.rows), j);
    update = Buffer();
  }

  void send_update(const Front& front, std::int32_t s) {
    MPI_Isend(loose_[s].data(), static_cast<int>(loose_[s].size()), MPI_DOUBLE, front.to_parent.rank, kUpdateTag + front.to_parent.tag,
              plan_.comm, &requests_.emplace_back());
    sent_fronts_.push_back(s);
  }

  /// Gives back what has arrived. Nothing is waited for: the receiver may need this rank's next front first.
  void release_sent() {
    for (std::size_t i = 0; i < requests_.size(); ++i) {
      int is_sent = 0;
      if (sent_fronts_[i] >= 0) MPI_Test(&requests_[i], &is_sent, MPI_STATUS_IGNORE);
      if (is_sent == 0) continue;
      loose_[sent_fronts_[i]] = Buffer();
      sent_fronts_[i] = -1;
    }
  }

  /// is_made: the update matrix holds nothing yet.
  void eliminate(const Front& front, bool is_made, double* panels) {
    for (std::int32_t p = 0; p < count_panels(front.width); ++p) {
      const int begin = 3 * find_panel_start(front.width, p);
      const int end = 3 * find_panel_start(front.width, p + 1);
      panels = eliminate_panel(3 * static_cast<std::size_t>(front.first), begin, end, is_made && p == 0, panels);
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
    kernels_.scale_by_d_inverse(wide_.data(), f_ - end, n, pivots, tiles, growth_);
    kernels_.update({tiles, wide_.data(), n, end}, w_, f_, is_made, starts_.data());
    return tiles + static_cast<std::ptrdiff_t>(f_ - end) * n;
  }

  /// triangle <- L^-1 of the diagonal block; zero with zero pivots when one vanishes, so that what follows stays finite.
  void factorise_diagonal(int begin, int n, BlockPivots& pivots, double* triangle) {
    double* block = block_.data();
    for (int j = 0; j < n; ++j)
      for (int i = j; i < n; ++i) block[j * kMaxBlock + i] = block[i * kMaxBlock + j] = starts_[begin + j][begin + i];
    if (kernels_.factorise_block(block, n, pivots, triangle)) {
      negative_ += pivots.negative;
      smallest_ = std::min(smallest_, pivots.smallest);
      return;
    }
    is_complete_ = false;
    std::fill(triangle, triangle + count_triangle(n), 0.0);
    std::fill(pivots.diagonal, pivots.diagonal + n, 0.0);
    std::fill(pivots.off, pivots.off + n, 0.0);
    std::iota(pivots.order, pivots.order + n, 0);
  }

  void reduce() {
    MPI_Allreduce(&negative_, &numbers_.negative, 1, MPI_INT64_T, MPI_SUM, plan_.comm);
    double extremes[3] = {-smallest_, growth_, is_complete_ ? 0.0 : 1.0};
    MPI_Allreduce(MPI_IN_PLACE, extremes, 3, MPI_DOUBLE, MPI_MAX, plan_.comm);
    numbers_.smallest = -extremes[0];
    numbers_.growth = extremes[1];
    numbers_.is_complete = extremes[2] == 0;
  }

  static constexpr int kBlockTag = 1;
  static constexpr int kUpdateTag = 2;

  const Plan& plan_;
  NodeRows k_;
  NodeRows m_;
  double k_factor_;  // of the entries of K and M: a and -sigma b of A = a K - sigma b M
  double m_factor_;
  Numbers& numbers_;
  const Kernels& kernels_;

  // The front in work: w pivot columns of f rows, and the update matrix of the r rows behind them.
  int w_ = 0;
  int r_ = 0;
  int f_ = 0;
  Buffer columns_;
  Buffer wide_;
  Buffer block_;
  double* update_ = nullptr;
  std::vector<double*> starts_;
  Ints where_;             // (local_nodes) node of the front in work
  std::vector<Run> runs_;  // of the child that is being added
  Ints node_runs_;         // the run of each of its nodes

  Buffer stack_[2];
  std::int64_t used_[2] = {0, 0};
  std::vector<Buffer> loose_;                // update matrices for the separator
  std::vector<std::vector<Buffer>> remote_;  // those of other ranks, packed
  std::vector<std::vector<double>> sent_;
  std::vector<std::vector<double>> received_;
  std::vector<std::size_t> block_at_;
  Ints own_of_local_;
  std::vector<MPI_Request> block_requests_;
  std::vector<MPI_Request> requests_;
  Ints sent_fronts_;  // (requests) whose update matrix it sends, -1: it has arrived

  std::int64_t negative_ = 0;
  double smallest_ = std::numeric_limits<double>::infinity();
  double growth_ = 0;
  bool is_complete_ = true;
};

}  // namespace

Buffer::Buffer(std::int64_t count, Pages pages_come) : size_(count) {
  if (count == 0) return;
  // Pages of the usual size: large ones made the solves 5 % faster, and the first factorisation up to twice as slow.
  constexpr std::size_t kAlignment = 64;
  constexpr std::size_t kMapped = 1 << 20;
  const std::size_t bytes = sizeof(double) * static_cast<std::size_t>(count);
  if (bytes < kMapped) {
    data_.reset(static_cast<double*>(std::aligned_alloc(kAlignment, (bytes + kAlignment - 1) / kAlignment * kAlignment)));
    if (data_ == nullptr) throw std::bad_alloc();
    return;
  }
  const int populate = pages_come == Pages::kAtOnce ? MAP_POPULATE : 0;
  void* pages = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | populate, -1, 0);
  if (pages == MAP_FAILED) throw std::bad_alloc();
  data_ = {static_cast<double*>(pages), FreeNumbers{bytes}};
}

void FreeNumbers::operator()(double* p) const {
  if (mapped_bytes == 0)
    std::free(p);
  else
    munmap(p, mapped_bytes);
}

Numbers make_numbers(const Plan& plan) {
  Numbers numbers;
  std::int64_t stored = 0;
  for (const Front& front : plan.fronts) {
    numbers.front_offsets.push_back(stored);
    stored += count_stored(front.width, front.size());
  }
  numbers.panels = Buffer(stored, Pages::kAtOnce);
  numbers.d_diagonal.assign(3 * static_cast<std::size_t>(plan.local_nodes), 0.0);
  numbers.d_off.assign(3 * static_cast<std::size_t>(plan.local_nodes), 0.0);
  numbers.order.assign(3 * static_cast<std::size_t>(plan.local_nodes), 0);
  return numbers;
}

void factorise_fronts(const Plan& plan, const la::Pencil& pencil, double sigma, Numbers& numbers) {
  std::unique_ptr<Factoriser> factoriser;
  comm::Communicator(plan.comm).agree([&] { factoriser = std::make_unique<Factoriser>(plan, pencil, sigma, numbers); });
  factoriser->run();
}

}  // namespace carillon::ldlt

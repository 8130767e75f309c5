// Method:     L D L^T X = B by fronts: forward in order of elimination, backward against it, on the rows of the right-hand sides where they
//             lie. Panels are applied as products (L11^-1 is at hand, so there is no triangular solve), and read once in each direction for
//             up to 32 columns. At a front of the separator the owner adds up what other ranks have gathered at its pivots, and on the way
//             back sends them the solution there.
// Source:     Liu 1992, section 6; Ashcraft, Eisenstat, Liu 1990, A fan-in algorithm for distributed sparse numerical factorization (sums
//             travel to the owner once).
// Deviations: none.
#include <algorithm>
#include <cstring>
#include <numeric>

#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/numeric.hpp"

namespace carillon::ldlt {
namespace {

/// One block of 8 or 16 columns.
struct Block {
  double* rows = nullptr;  // (3 local_nodes) rows of `width` numbers
  int width = 0;
  int columns = 0;  // of them in use
  int first_column = 0;
};

class Solver {
 public:
  Solver(const Plan& plan, const Numbers& numbers, Workspace& workspace, int columns)
      : plan_(plan), numbers_(numbers), kernels_(get_kernels()) {
    for (int first = 0; first < columns; first += 16) {
      const int count = std::min(16, columns - first);
      blocks_.push_back({workspace.blocks[static_cast<std::size_t>(first / 16)].data(), count > 8 ? 16 : 8, count, first});
      row_width_ += blocks_.back().width;
    }
  }

  void load(const double* b, std::ptrdiff_t stride) const {
    for (const Block& block : blocks_) {
      std::memset(
          find_row(block, plan_.subdomain_nodes), 0,
          sizeof(double) * 3 * static_cast<std::size_t>(plan_.local_nodes - plan_.subdomain_nodes) * static_cast<std::size_t>(block.width));
      load_own(block, b + block.first_column * stride, stride);
    }
  }

  /// By strips of nodes that stay in the first-level cache. Columns are written in whole runs: one number of each at a time would wait for
  /// memory at every line.
  void store(double* x, std::ptrdiff_t stride) const {
    alignas(64) double rows[kColumn * kWidth];
    alignas(64) double strip[kWidth * kColumn];
    for (const Block& block : blocks_)
      for (std::ptrdiff_t first = 0; first < plan_.own_nodes; first += kStrip) {
        const std::ptrdiff_t nodes = std::min<std::ptrdiff_t>(kStrip, plan_.own_nodes - first);
        prefetch_columns<true>(block, x + block.first_column * stride, stride, first + kStrip);
        for (std::ptrdiff_t v = 0; v < nodes; ++v) {
          prefetch_rows(block, first + v, false);
          copy_node(find_own(block, first + v), block.width, rows + 3 * v * block.width);
        }
        kernels_.transpose(rows, block.width, static_cast<int>(3 * nodes), block.columns, strip, kColumn);
        for (int c = 0; c < block.columns; ++c)
          std::memcpy(x + (block.first_column + c) * stride + 3 * first, strip + c * kColumn,
                      sizeof(double) * 3 * static_cast<std::size_t>(nodes));
      }
  }

  void forward() {
    for (std::int32_t s = 0; s < plan_.subdomain_fronts; ++s) forward(s);
    for (const SolveExchange& exchange : plan_.exchanges) {
      if (exchange.front >= 0) {
        for (const SolveExchange::Participant& participant : exchange.participants)
          receive(participant.rank, exchange.tag, participant.nodes, true);
        forward(exchange.front);
      } else {
        send(exchange.owner, exchange.tag, exchange.nodes);
      }
    }
    finish_sends();
  }

  void backward() {
    for (auto exchange = plan_.exchanges.rbegin(); exchange != plan_.exchanges.rend(); ++exchange) {
      if (exchange->front >= 0) {
        backward(exchange->front);
        for (const SolveExchange::Participant& participant : exchange->participants)
          send(participant.rank, exchange->tag, participant.nodes);
      } else {
        receive(exchange->owner, exchange->tag, exchange->nodes, false);
      }
    }
    for (std::int32_t s = plan_.subdomain_fronts; s-- > 0;) backward(s);
    finish_sends();
  }

 private:
  static constexpr std::ptrdiff_t kStrip = 32;  // nodes whose rows of 16 and columns are in the first-level cache together
  static constexpr std::ptrdiff_t kColumn = 3 * kStrip, kWidth = 16;  // numbers of a strip in a column; columns of a block at most

  /// The rows of the own nodes; columns that are not in use become zero.
  void load_own(const Block& block, const double* b, std::ptrdiff_t stride) const {
    alignas(64) double rows[kColumn * kWidth];
    alignas(64) double strip[kWidth * kColumn];
    std::memset(strip, 0, sizeof(strip));
    for (std::ptrdiff_t first = 0; first < plan_.own_nodes; first += kStrip) {
      const std::ptrdiff_t nodes = std::min<std::ptrdiff_t>(kStrip, plan_.own_nodes - first);
      prefetch_columns(block, b, stride, first + kStrip);
      for (int c = 0; c < block.columns; ++c)
        std::memcpy(strip + c * kColumn, b + c * stride + 3 * first, sizeof(double) * 3 * static_cast<std::size_t>(nodes));
      kernels_.transpose(strip, kColumn, block.width, static_cast<int>(3 * nodes), rows, block.width);
      for (std::ptrdiff_t v = 0; v < nodes; ++v) {
        prefetch_rows(block, first + v, true);
        copy_node(rows + 3 * v * block.width, block.width, find_own(block, first + v));
      }
    }
  }

  static double* find_row(const Block& block, std::int32_t node) {
    return block.rows + 3 * static_cast<std::ptrdiff_t>(node) * block.width;
  }

  double* find_own(const Block& block, std::ptrdiff_t v) const { return find_row(block, plan_.node_of_own[static_cast<std::size_t>(v)]); }

  /// Prefetches the strip that begins at an own node: runs as short as it has in a column are over before the processor sees them.
  template <bool kIsWritten = false>
  void prefetch_columns(const Block& block, const double* columns, std::ptrdiff_t stride, std::ptrdiff_t first) const {
    const std::ptrdiff_t count = 3 * std::min<std::ptrdiff_t>(kStrip, plan_.own_nodes - first);
    for (int c = 0; c < block.columns; ++c)
      for (std::ptrdiff_t i = 0; i < count; i += 8) __builtin_prefetch(columns + c * stride + 3 * first + i, kIsWritten ? 1 : 0);
  }

  /// Prefetches the rows of a later own node: they lie anywhere.
  void prefetch_rows(const Block& block, std::ptrdiff_t v, bool is_written) const {
    constexpr std::ptrdiff_t kAhead = 12;
    const double* rows = find_own(block, std::min<std::ptrdiff_t>(v + kAhead, plan_.own_nodes - 1));
    for (int i = 0; i < 3 * block.width; i += 8) is_written ? __builtin_prefetch(rows + i, 1) : __builtin_prefetch(rows + i);
  }

  const std::uint8_t* find_order(const Front& front, int begin) const {
    return numbers_.order.data() + 3 * static_cast<std::size_t>(front.first) + static_cast<std::size_t>(begin);
  }

  static void copy_row(const double* from, int width, double* to) {
    if (width == 16)
      std::memcpy(to, from, 16 * sizeof(double));
    else
      std::memcpy(to, from, 8 * sizeof(double));
  }

  static void copy_node(const double* from, int width, double* to) {
    if (width == 16)
      std::memcpy(to, from, 3 * 16 * sizeof(double));
    else
      std::memcpy(to, from, 3 * 8 * sizeof(double));
  }

  /// nodes_: the nodes of a front.
  void list_nodes(const Front& front) {
    nodes_.resize(static_cast<std::size_t>(front.size()));
    std::iota(nodes_.begin(), nodes_.begin() + front.width, front.first);
    std::copy(front.rows.begin(), front.rows.end(), nodes_.begin() + front.width);
  }

  void forward(std::int32_t s) {
    const Front& front = plan_.fronts[s];
    list_nodes(front);
    alignas(64) double pivots[kMaxBlock * 16];
    const double* tiles = numbers_.panels.data() + numbers_.front_offsets[s];
    for (std::int32_t p = 0; p < count_panels(front.width); ++p) {
      const int begin = 3 * find_panel_start(front.width, p);
      const int end = 3 * find_panel_start(front.width, p + 1);
      const int n = end - begin;
      const int m = 3 * front.size() - end;
      const std::uint8_t* order = find_order(front, begin);
      for (const Block& block : blocks_) {
        double* own = find_row(block, front.first) + begin * block.width;
        for (int k = 0; k < n; ++k) copy_row(own + order[k] * block.width, block.width, pivots + k * block.width);
        kernels_.trmm(tiles, n, block.width / 8, pivots, own);
        kernels_.subtract_product(tiles + count_triangle(n), m, n, block.width / 8, own, nodes_.data() + end / 3, block.rows);
      }
      tiles += count_triangle(n) + static_cast<std::ptrdiff_t>(n) * m;
    }
  }

  void backward(std::int32_t s) {
    const Front& front = plan_.fronts[s];
    list_nodes(front);
    alignas(64) double pivots[kMaxBlock * 16];
    alignas(64) double solution[kMaxBlock * 16];
    const double* tiles = numbers_.panels.data() + numbers_.front_offsets[s] + count_stored(front.width, front.size());
    for (std::int32_t p = count_panels(front.width); p-- > 0;) {
      const int begin = 3 * find_panel_start(front.width, p);
      const int end = 3 * find_panel_start(front.width, p + 1);
      const int n = end - begin;
      const int m = 3 * front.size() - end;
      const std::uint8_t* order = find_order(front, begin);
      const auto first_row = static_cast<std::size_t>(3 * front.first + begin);
      tiles -= count_triangle(n) + static_cast<std::ptrdiff_t>(n) * m;
      const double* next = tiles - find_below(s, p);
      for (const Block& block : blocks_) {
        double* own = find_row(block, front.first) + begin * block.width;
        kernels_.multiply_by_d_inverse(numbers_.d_diagonal.data() + first_row, numbers_.d_off.data() + first_row, n, block.width / 8, own,
                                       pivots);
        kernels_.subtract_transposed(tiles + count_triangle(n), m, n, block.width / 8, nodes_.data() + end / 3, block.rows, pivots, tiles);
        std::memset(solution, 0, sizeof(double) * static_cast<std::size_t>(n * block.width));
        kernels_.add_trmm_transposed(tiles, n, block.width / 8, pivots, solution,
                                     &block == &blocks_.back() ? next : tiles + count_triangle(n));
        for (int k = 0; k < n; ++k) copy_row(solution + k * block.width, block.width, own + order[k] * block.width);
      }
    }
  }

  /// Numbers of L21 of the panel that stands before panel p of front s.
  std::ptrdiff_t find_below(std::int32_t s, std::int32_t p) const {
    if (p == 0 && s == 0) return 0;
    const Front& front = plan_.fronts[p > 0 ? s : s - 1];
    if (p == 0) p = count_panels(front.width);
    const int end = 3 * find_panel_start(front.width, p);
    return static_cast<std::ptrdiff_t>(end - 3 * find_panel_start(front.width, p - 1)) * (3 * front.size() - end);
  }

  void send(int rank, int tag, const Ints& nodes) {
    std::vector<double>& message = messages_.emplace_back();
    message.reserve(3 * nodes.size() * static_cast<std::size_t>(row_width_));
    for (const Block& block : blocks_)
      for (const std::int32_t node : nodes) message.insert(message.end(), find_row(block, node), find_row(block, node) + 3 * block.width);
    MPI_Isend(message.data(), static_cast<int>(message.size()), MPI_DOUBLE, rank, tag, plan_.comm, &requests_.emplace_back());
  }

  void receive(int rank, int tag, const Ints& nodes, bool add) {
    received_.resize(3 * nodes.size() * static_cast<std::size_t>(row_width_));
    MPI_Recv(received_.data(), static_cast<int>(received_.size()), MPI_DOUBLE, rank, tag, plan_.comm, MPI_STATUS_IGNORE);
    const double* from = received_.data();
    for (const Block& block : blocks_)
      for (const std::int32_t node : nodes) {
        double* row = find_row(block, node);
        for (int i = 0; i < 3 * block.width; ++i) row[i] = add ? row[i] + from[i] : from[i];
        from += 3 * block.width;
      }
  }

  void finish_sends() {
    MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
    requests_.clear();
    messages_.clear();
  }

  const Plan& plan_;
  const Numbers& numbers_;
  const Kernels& kernels_;
  std::vector<Block> blocks_;
  Ints nodes_;  // of the front in work
  int row_width_ = 0;
  std::vector<std::vector<double>> messages_;
  std::vector<double> received_;
  std::vector<MPI_Request> requests_;
};

}  // namespace

Workspace make_workspace(const Plan& plan) {
  Workspace workspace;
  for (int first = 0; first < kSolveColumns; first += 16) workspace.blocks.emplace_back(std::int64_t{3 * 16} * plan.local_nodes);
  return workspace;
}

void solve_columns(const Plan& plan, const Numbers& numbers, Workspace& workspace, const double* b, double* x, int stride, int columns) {
  Solver solver(plan, numbers, workspace, columns);
  solver.load(b, stride);
  solver.forward();
  solver.backward();
  solver.store(x, stride);
}

}  // namespace carillon::ldlt

// Method: L D L^T X = B by fronts: forward in elimination order, backward in reverse, in place on the rows of the right-hand sides. Panels
// are applied as products (L11^-1 is stored, so there is no triangular solve) and read once in each direction for up to 32 columns. For a
// shared front each rank multiplies its tiles; the owner of a diagonal tile sums the partial results along its row and sends its part of
// the solution down its column; backward, along its row. The row of the next panel is multiplied first, so that the next owner can start;
// rows behind the pivots, on which no panel of the front waits, while the rank waits for messages.
// Source: Liu 1992, section 6; Ashcraft, Eisenstat, Liu 1990, A fan-in algorithm for distributed sparse numerical factorization (sums
// travel to the owner once).
#include <algorithm>
#include <cstring>
#include <deque>
#include <list>
#include <map>
#include <numeric>

#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/numeric.hpp"
#include "precompute/ldlt/storage.hpp"

namespace carillon::ldlt {
namespace {

/// A block of 8 or 16 columns.
struct Block {
  double* rows = nullptr;  // (3 slots) rows of `width` numbers
  int width = 0;
  int columns = 0;  // used columns
  int first_column = 0;
};

class Solver {
 public:
  Solver(const Plan& plan, const Numbers& numbers, Workspace& workspace, int columns)
      : plan_(plan), numbers_(numbers), kernels_(find_solve_kernels()) {
    for (int first = 0; first < columns; first += kBlockColumns) {
      const int count = std::min(kBlockColumns, columns - first);
      blocks_.push_back({workspace.blocks[first / kBlockColumns], count > 8 ? 16 : 8, count, first});
      row_width_ += blocks_.back().width;
    }
    columns_ = workspace.columns.data();
  }

  void load(const double* b, std::ptrdiff_t stride) {
    for (const Block& block : blocks_) {
      std::memset(
          find_row(block, plan_.pivot_nodes), 0,
          sizeof(double) * 3 * static_cast<std::size_t>(plan_.given_slots - plan_.pivot_nodes) * static_cast<std::size_t>(block.width));
      load_own(block, b + block.first_column * stride, stride);
    }
    for (const GivenRows& given : plan_.given) send(given.rank, kGivenTag, list_given(given));
    for (const TakenRows& taken : plan_.taken) receive(taken.rank, kGivenTag, taken.slots, Arrival::kIsSet);
    finish_sends();
  }

  /// Returns solutions of rows of other ranks to them.
  void give_back() {
    for (const TakenRows& taken : plan_.taken) send(taken.rank, kGivenTag, taken.slots);
    for (const GivenRows& given : plan_.given) receive(given.rank, kGivenTag, list_given(given), Arrival::kIsSet);
    finish_sends();
  }

  /// Works by strips of nodes that fit the first-level cache. Columns are written in contiguous runs: writing single numbers would wait for
  /// memory at every cache line.
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
          std::memcpy(x + (block.first_column + c) * stride + 3 * first, strip + c * kColumn, sizeof(double) * 3 * nodes);
      }
  }

  void forward() {
    for (std::int32_t s = 0; s < static_cast<std::int32_t>(plan_.fronts.size()); ++s) {
      forward(s);
      const Front& front = plan_.fronts[s];
      if (front.shared_parent < 0) continue;
      for (const SumMessage& sums : front.to_parent) send_sums(sums, kSums);
      for (const Block& block : blocks_)
        for (const std::int32_t row : front.rows) std::memset(find_row(block, row), 0, sizeof(double) * 3 * block.width);
    }
    for (std::size_t f = 0; f < plan_.shared.size(); ++f) forward_shared(f);
    finish_sends();
  }

  void backward() {
    for (std::size_t f = plan_.shared.size(); f-- > 0;) backward_shared(f);
    for (const Front& front : plan_.fronts)
      for (const SumMessage& sums : front.to_parent) receive_sums(sums, kSolutions, Arrival::kIsSet);
    for (std::int32_t s = static_cast<std::int32_t>(plan_.fronts.size()); s-- > 0;) backward(s);
    finish_sends();
  }

 private:
  static constexpr std::ptrdiff_t kStrip = 32;  // nodes whose rows of 16 numbers and columns fit the first-level cache together
  static constexpr std::ptrdiff_t kColumn = 3 * kStrip, kWidth = 16;  // numbers of a strip in a column; maximum columns of a block

  /// Loads the rows of the own nodes; unused columns are set to zero.
  void load_own(const Block& block, const double* b, std::ptrdiff_t stride) const {
    alignas(64) double rows[kColumn * kWidth];
    alignas(64) double strip[kWidth * kColumn];
    std::memset(strip, 0, sizeof(strip));
    for (std::ptrdiff_t first = 0; first < plan_.own_nodes; first += kStrip) {
      const std::ptrdiff_t nodes = std::min<std::ptrdiff_t>(kStrip, plan_.own_nodes - first);
      prefetch_columns(block, b, stride, first + kStrip);
      for (int c = 0; c < block.columns; ++c) std::memcpy(strip + c * kColumn, b + c * stride + 3 * first, sizeof(double) * 3 * nodes);
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

  double* find_own(const Block& block, std::ptrdiff_t v) const { return find_row(block, plan_.slot_of_own[v]); }

  /// Prefetches the strip starting at an own node: its runs in a column are too short for the hardware prefetcher.
  template <bool kIsWritten = false>
  void prefetch_columns(const Block& block, const double* columns, std::ptrdiff_t stride, std::ptrdiff_t first) const {
    const std::ptrdiff_t count = 3 * std::min<std::ptrdiff_t>(kStrip, plan_.own_nodes - first);
    for (int c = 0; c < block.columns; ++c)
      for (std::ptrdiff_t i = 0; i < count; i += 8) __builtin_prefetch(columns + c * stride + 3 * first + i, kIsWritten ? 1 : 0);
  }

  /// Prefetches the rows of a later own node, as their addresses are irregular.
  void prefetch_rows(const Block& block, std::ptrdiff_t v, bool is_written) const {
    constexpr std::ptrdiff_t kAhead = 12;
    const double* rows = find_own(block, std::min<std::ptrdiff_t>(v + kAhead, plan_.own_nodes - 1));
    for (int i = 0; i < 3 * block.width; i += 8) is_written ? __builtin_prefetch(rows + i, 1) : __builtin_prefetch(rows + i);
  }

  const std::uint8_t* find_order(const Front& front, int begin) const {
    return numbers_.order.data() + 3 * front.first + static_cast<std::size_t>(begin);
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

  /// nodes_: nodes of a front.
  void list_nodes(const Front& front) {
    nodes_.resize(front.size());
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
      const std::size_t first_row = 3 * front.first + begin;
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

  /// Numbers of L21 of the panel before panel p of front s.
  std::ptrdiff_t find_below(std::int32_t s, std::int32_t p) const {
    if (p == 0 && s == 0) return 0;
    const Front& front = plan_.fronts[p > 0 ? s : s - 1];
    if (p == 0) p = count_panels(front.width);
    const int end = 3 * find_panel_start(front.width, p);
    return static_cast<std::ptrdiff_t>(end - 3 * find_panel_start(front.width, p - 1)) * (3 * front.size() - end);
  }

  // ---- shared fronts ----

  enum class Arrival { kIsSet, kIsAdded };
  enum Tag { kSums, kAlongRow, kAlongColumn, kSolutions, kTags };
  static constexpr int kGivenTag = 8;
  static constexpr int kFirstTag = 128;
  static int find_tag(std::int32_t front, Tag tag) { return kFirstTag + kTags * front + tag; }

  static Ints list_given(const GivenRows& given) {
    Ints slots(given.count);
    std::iota(slots.begin(), slots.end(), given.first_slot);
    return slots;
  }

  static bool contains(const std::vector<int>& places, int place) { return std::find(places.begin(), places.end(), place) != places.end(); }

  /// Subtracts the tiles of column k, own nodes `begin` to `end`, times the solution there.
  void subtract_column(const SharedFront& front, const double* tiles, int k, std::int32_t begin, std::int32_t end,
                       const std::vector<double*>& in) {
    const int n = 3 * front.map.nodes(k);
    const std::int32_t first = front.row_begin[k + 1];
    if (begin == end) return;
    for (std::size_t b = 0; b < blocks_.size(); ++b)
      kernels_.subtract_product(tiles + std::int64_t{3} * (begin - first) * n, 3 * (end - begin), n, blocks_[b].width / 8, in[b],
                                nodes_.data() + begin, blocks_[b].rows);
  }

  /// First row of tile row i in each block.
  std::vector<double*> list_rows(const SharedFront& front, int i) const {
    std::vector<double*> rows;
    for (const Block& block : blocks_) rows.push_back(find_row(block, front.first_slot + front.row_begin[i]));
    return rows;
  }

  /// Room for a panel's part of each block.
  std::vector<double*> list_panel(int k) const {
    std::vector<double*> rows;
    for (std::size_t b = 0; b < blocks_.size(); ++b) rows.push_back(columns_ + (k * blocks_.size() + b) * kMaxBlock * kWidth);
    return rows;
  }

  void forward_shared(std::size_t f) {
    const SharedFront& front = plan_.shared[f];
    for (const SumMessage& sums : front.from_children) receive_sums(sums, kSums, Arrival::kIsAdded);
    nodes_.resize(front.own_nodes());
    std::iota(nodes_.begin(), nodes_.end(), front.first_slot);
    const std::int32_t behind = front.row_begin[front.map.pivot_tiles()];
    std::vector<std::vector<double*>> solutions(front.map.pivot_tiles());  // of the columns of this rank
    alignas(64) double pivots[kMaxBlock * 16];
    for (int k = 0; k < front.map.pivot_tiles(); ++k) {
      const SharedPanel& panel = numbers_.shared[f][k];
      const int home = front.map.owner(k, k);
      const int n = 3 * front.map.nodes(k);
      const std::vector<int>& column = front.column_places[k];
      std::vector<double*>& in = solutions[k];
      if (home == front.place) {
        in = list_rows(front, k);
        const std::vector<int>& row = front.row_places[k];
        for (auto place = row.rbegin(); place != row.rend(); ++place)  // the nearest comes last
          receive_rows(front.map.rank(*place), find_tag(front.id, kAlongRow), n, in, Arrival::kIsAdded);
        for (std::size_t b = 0; b < blocks_.size(); ++b) {
          const int width = blocks_[b].width;
          const std::uint8_t* order = numbers_.order.data() + panel.pivots;
          for (int c = 0; c < n; ++c) copy_row(in[b] + order[c] * width, width, pivots + c * width);
          kernels_.trmm(numbers_.panels.data() + panel.triangle, n, width / 8, pivots, in[b]);
        }
        for (const int place : column) send_rows(front.map.rank(place), find_tag(front.id, kAlongColumn), n, in);
      } else if (contains(column, front.place)) {
        in = list_panel(k);
        receive_rows(front.map.rank(home), find_tag(front.id, kAlongColumn), n, in, Arrival::kIsSet);
      }
      const std::int32_t begin = front.row_begin[k + 1];
      const std::int32_t next = k + 1 < front.map.pivot_tiles() ? front.row_begin[k + 2] : begin;
      const double* tiles = numbers_.find_tiles(panel);
      if (!in.empty()) subtract_column(front, tiles, k, begin, next, in);
      if (k + 1 < front.map.pivot_tiles() && contains(front.row_places[k + 1], front.place))
        send_rows(front.map.rank(front.map.owner(k + 1, k + 1)), find_tag(front.id, kAlongRow), 3 * front.map.nodes(k + 1),
                  list_rows(front, k + 1));
      if (in.empty()) continue;
      subtract_column(front, tiles, k, next, behind, in);
      defer(&Solver::subtract_column, front, tiles, k, in);
    }
    do_later(0);
    for (const SumMessage& sums : front.to_parent) send_sums(sums, kSums);
  }

  void backward_shared(std::size_t f) {
    const SharedFront& front = plan_.shared[f];
    for (const SumMessage& sums : front.to_parent) receive_sums(sums, kSolutions, Arrival::kIsSet);
    nodes_.resize(front.own_nodes());
    std::iota(nodes_.begin(), nodes_.end(), front.first_slot);
    const std::int32_t behind = front.row_begin[front.map.pivot_tiles()];
    std::vector<std::vector<double*>> sums_of_panel(front.map.pivot_tiles());  // of the columns of this rank
    for (int k = front.map.pivot_tiles(); k-- > 0;) {
      const SharedPanel& panel = numbers_.shared[f][k];
      const bool is_home = front.map.owner(k, k) == front.place;
      if (!is_home && !contains(front.column_places[k], front.place)) continue;
      const int n = 3 * front.map.nodes(k);
      const std::vector<double*>& sums = sums_of_panel[k] = list_panel(k);
      for (std::size_t b = 0; b < blocks_.size(); ++b)
        std::memset(sums[b], 0, sizeof(double) * static_cast<std::size_t>(n * blocks_[b].width));
      if (is_home) {
        const std::vector<double*> own = list_rows(front, k);
        for (std::size_t b = 0; b < blocks_.size(); ++b)
          kernels_.multiply_by_d_inverse(numbers_.d_diagonal.data() + panel.pivots, numbers_.d_off.data() + panel.pivots, n,
                                         blocks_[b].width / 8, own[b], sums[b]);
      }
      defer(&Solver::subtract_rows, front, numbers_.find_tiles(panel), k, sums);
    }
    for (int k = front.map.pivot_tiles(); k-- > 0;) {
      const SharedPanel& panel = numbers_.shared[f][k];
      const bool is_home = front.map.owner(k, k) == front.place;
      const int n = 3 * front.map.nodes(k);
      const std::vector<double*>& sums = sums_of_panel[k];
      const std::int32_t begin = front.row_begin[k + 1];
      const std::int32_t next = k + 1 < front.map.pivot_tiles() ? front.row_begin[k + 2] : begin;
      const double* tiles = numbers_.find_tiles(panel);
      do_later(k);
      if (!sums.empty()) subtract_rows(front, tiles, k, next, behind, sums);
      if (k + 1 < front.map.pivot_tiles() && contains(front.row_places[k + 1], front.place))
        receive_rows(front.map.rank(front.map.owner(k + 1, k + 1)), find_tag(front.id, kAlongRow), 3 * front.map.nodes(k + 1),
                     list_rows(front, k + 1), Arrival::kIsSet);
      if (!sums.empty()) subtract_rows(front, tiles, k, begin, next, sums);
      if (!is_home) {
        // Copied, as their room serves the next front.
        if (!sums.empty()) send_copy(front.map.rank(front.map.owner(k, k)), find_tag(front.id, kAlongColumn), n, sums);
        continue;
      }
      const std::vector<int>& column = front.column_places[k];
      for (auto place = column.rbegin(); place != column.rend(); ++place)
        receive_rows(front.map.rank(*place), find_tag(front.id, kAlongColumn), n, sums, Arrival::kIsAdded);
      alignas(64) double solution[kMaxBlock * 16];
      const std::vector<double*> own = list_rows(front, k);
      const double* triangle = numbers_.panels.data() + panel.triangle;
      for (std::size_t b = 0; b < blocks_.size(); ++b) {
        const int width = blocks_[b].width;
        std::memset(solution, 0, sizeof(double) * static_cast<std::size_t>(n * width));
        kernels_.add_trmm_transposed(triangle, n, width / 8, sums[b], solution, triangle);
        for (int c = 0; c < n; ++c) copy_row(solution + c * width, width, own[b] + numbers_.order[panel.pivots + c] * width);
      }
      for (const int place : front.row_places[k]) send_rows(front.map.rank(place), find_tag(front.id, kAlongRow), n, own);
    }
    for (const SumMessage& sums : front.from_children) send_sums(sums, kSolutions);
  }

  /// sums -= L^T X for the tiles of column k, own nodes `begin` to `end`.
  void subtract_rows(const SharedFront& front, const double* tiles, int k, std::int32_t begin, std::int32_t end,
                     const std::vector<double*>& sums) {
    if (begin == end) return;
    const int n = 3 * front.map.nodes(k);
    const double* from = tiles + std::int64_t{3} * (begin - front.row_begin[k + 1]) * n;
    for (std::size_t b = 0; b < blocks_.size(); ++b)
      kernels_.subtract_transposed(from, 3 * (end - begin), n, blocks_[b].width / 8, nodes_.data() + begin, blocks_[b].rows, sums[b], from);
  }

  using Subtract = void (Solver::*)(const SharedFront& front, const double* tiles, int k, std::int32_t begin, std::int32_t end,
                                    const std::vector<double*>& rows);
  /// Deferred product of a tile behind the pivots of a front.
  struct Later {
    Subtract subtract;
    const SharedFront* front;
    const double* tiles;
    int panel;
    std::int32_t row;
    const std::vector<double*>* rows;
  };

  /// Defers the products of panel k with the rows behind the pivots. `rows` must stay until they are done.
  void defer(Subtract subtract, const SharedFront& front, const double* tiles, int k, const std::vector<double*>& rows) {
    for (std::int32_t row = front.row_begin[front.map.pivot_tiles()]; row < front.own_nodes(); row += kPanelNodes)
      later_.push_back({subtract, &front, tiles, k, row, &rows});
  }

  void do_next() {
    const Later next = later_.front();
    later_.pop_front();
    (this->*next.subtract)(*next.front, next.tiles, next.panel, next.row, std::min(next.row + kPanelNodes, next.front->own_nodes()),
                           *next.rows);
  }

  /// Does the deferred products of panels >= k.
  void do_later(int k) {
    while (!later_.empty() && later_.front().panel >= k) do_next();
  }

  // ---- messages ----

  /// Sums to or from this rank itself are kept by child, without a message.
  void send_sums(const SumMessage& sums, Tag tag) {
    if (sums.rank != plan_.rank) {
      send(sums.rank, find_tag(sums.child, tag), sums.slots);
      return;
    }
    std::vector<double>& kept = kept_[sums.child];
    kept.clear();
    pack(sums.slots, kept);
  }

  void receive_sums(const SumMessage& sums, Tag tag, Arrival arrival) {
    if (sums.rank == plan_.rank)
      unpack(kept_[sums.child].data(), sums.slots, arrival);
    else
      receive(sums.rank, find_tag(sums.child, tag), sums.slots, arrival);
  }

  /// Rows of nodes that lie apart, of all blocks in one message.
  void pack(const Ints& slots, std::vector<double>& message) const {
    message.resize(3 * slots.size() * static_cast<std::size_t>(row_width_));
    double* to = message.data();
    for (const Block& block : blocks_)
      for (const std::int32_t slot : slots) {
        kernels_.copy(find_row(block, slot), 3 * block.width, to);
        to += 3 * block.width;
      }
  }

  void unpack(const double* from, const Ints& slots, Arrival arrival) const {
    const auto move = arrival == Arrival::kIsAdded ? kernels_.add : kernels_.copy;
    for (const Block& block : blocks_)
      for (const std::int32_t slot : slots) {
        move(from, 3 * block.width, find_row(block, slot));
        from += 3 * block.width;
      }
  }

  void send(int rank, int tag, const Ints& slots) {
    std::vector<double>& message = messages_.emplace_back();
    pack(slots, message);
    send_numbers(rank, tag, message.data(), message.size());
  }

  void receive(int rank, int tag, const Ints& slots, Arrival arrival) {
    received_.resize(3 * slots.size() * static_cast<std::size_t>(row_width_));
    receive_numbers(rank, tag, received_.data(), received_.size());
    unpack(received_.data(), slots, arrival);
  }

  /// n rows of each block, a message a block, from where they are: they must stay until finish_sends().
  void send_rows(int rank, int tag, int n, const std::vector<double*>& rows) {
    for (std::size_t b = 0; b < blocks_.size(); ++b) send_numbers(rank, tag, rows[b], static_cast<std::size_t>(n * blocks_[b].width));
  }

  void send_copy(int rank, int tag, int n, const std::vector<double*>& rows) {
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      std::vector<double>& message = messages_.emplace_back(n * blocks_[b].width);
      kernels_.copy(rows[b], n * blocks_[b].width, message.data());
      send_numbers(rank, tag, message.data(), message.size());
    }
  }

  void receive_rows(int rank, int tag, int n, const std::vector<double*>& rows, Arrival arrival) {
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      const int count = n * blocks_[b].width;
      if (arrival == Arrival::kIsSet) {
        receive_numbers(rank, tag, rows[b], static_cast<std::size_t>(count));
        continue;
      }
      received_.resize(static_cast<std::size_t>(count));
      receive_numbers(rank, tag, received_.data(), received_.size());
      kernels_.add(received_.data(), count, rows[b]);
    }
  }

  void send_numbers(int rank, int tag, const double* from, std::size_t count) {
    MPI_Isend(from, static_cast<int>(count), MPI_DOUBLE, rank, tag, plan_.comm, &requests_.emplace_back());
  }

  /// Does deferred products until the message arrives.
  void receive_numbers(int rank, int tag, double* to, std::size_t count) {
    MPI_Request request = MPI_REQUEST_NULL;
    MPI_Irecv(to, static_cast<int>(count), MPI_DOUBLE, rank, tag, plan_.comm, &request);
    while (!later_.empty()) {
      int has_come = 0;
      MPI_Test(&request, &has_come, MPI_STATUS_IGNORE);
      if (has_come != 0) return;
      do_next();
    }
    MPI_Wait(&request, MPI_STATUS_IGNORE);
  }

  void finish_sends() {
    MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
    requests_.clear();
    messages_.clear();
  }

  const Plan& plan_;
  const Numbers& numbers_;
  const SolveKernels& kernels_;
  std::vector<Block> blocks_;
  Ints nodes_;  // of the current front
  int row_width_ = 0;
  double* columns_ = nullptr;                         // Workspace::columns
  std::map<std::int32_t, std::vector<double>> kept_;  // by child
  std::deque<Later> later_;                           // of the current front
  std::list<std::vector<double>> messages_;
  std::vector<double> received_;
  std::vector<MPI_Request> requests_;
};

}  // namespace

Workspace make_workspace(const Plan& plan, const Numbers& numbers) {
  Workspace workspace;
  std::int64_t panels = 0;
  for (const SharedFront& front : plan.shared) panels = std::max<std::int64_t>(panels, front.map.pivot_tiles());
  workspace.columns = Buffer(panels * kMaxBlock * kSolveColumns);
  for (int block = 0; block < kSolveColumns / kBlockColumns; ++block) {
    if (block < plan.room.solve_blocks)
      workspace.blocks.push_back(numbers.panels.data() + plan.room.solve_begin() + block * plan.count_block());
    else
      workspace.blocks.push_back(workspace.buffers.emplace_back(plan.count_block()).data());
  }
  return workspace;
}

void solve_columns(const Plan& plan, const Numbers& numbers, Workspace& workspace, const double* b, double* x, int stride, int columns) {
  Solver solver(plan, numbers, workspace, columns);
  solver.load(b, stride);
  solver.forward();
  solver.backward();
  solver.give_back();
  solver.store(x, stride);
}

}  // namespace carillon::ldlt

// Method: Right-looking L D L^T of a front in tiles. The owner of a diagonal tile factorises it with pivoting inside and sends L11^-1 and D
// down its column; the owners of the column compute W = A21 P^T L11^-T and L21 = W D^-1 and send W to ranks with tiles in the same rows, or
// in the columns of the same number; each updates its own tiles, the next column first, so that the next panel overlaps with the update of
// the rest. The contribution block of a child is sent by tiles to the owners in the parent. Pivot columns lie slightly behind the place of
// their panels, as for own fronts (storage.hpp). Panels are sent to each receiver by their owner, not along trees.
// Source: Gupta, Karypis, Kumar 1997 (fronts in two dimensions); Duff and Reid 1983 (extend-add). Kernels and pivots: numeric.cpp.
// Termination with messages in flight: Hoefler, Siebert, Lumsdaine 2010, Scalable communication protocols for dynamic sparse data exchange
// (nonblocking reduction while messages are received).
#include "precompute/ldlt/shared.hpp"

#include <algorithm>
#include <new>

#include "precompute/comm/communicator.hpp"
#include "precompute/ldlt/storage.hpp"

namespace carillon::ldlt {
namespace {

enum Kind : std::int32_t { kUpdate, kDiagonal, kPanel, kAbort };

/// Numbers of D^-1 before the rows of a panel: diagonal and off-diagonal.
constexpr std::int64_t kPivotNumbers = 2 * kMaxBlock;

/// Tile columns behind the pivots are grouped in buffers of this size (4 MB), at most one column more, which fit into the kept pages.
constexpr std::int64_t kPieceNumbers = std::int64_t{1} << 19;

std::int64_t count_strips(std::int64_t rows) { return (rows + kWideRows - 1) / kWideRows * kWideRows; }

/// Calls copy(in the strips, in the block, count) for the runs of a range of rows, between strips of n columns and a column-major block.
template <typename Strips, typename Block, typename Copy>
void for_strip_runs(Strips* wide, int n, std::int64_t first, std::int64_t rows, Block* block, Copy&& copy) {
  for (int k = 0; k < n; ++k, block += rows)
    for (std::int64_t r = 0; r < rows;) {
      const std::int64_t at = first + r;
      const std::int64_t run = std::min<std::int64_t>(kWideRows - at % kWideRows, rows - r);
      copy(wide + at / kWideRows * kWideRows * n + std::int64_t{k} * kWideRows + at % kWideRows, block + r, run);
      r += run;
    }
}
void copy_from_strips(const double* wide, int n, std::int64_t first, std::int64_t rows, double* block) {
  for_strip_runs(wide, n, first, rows, block, [](const double* from, double* to, std::int64_t count) { std::copy_n(from, count, to); });
}
void copy_to_strips(const double* block, int n, std::int64_t first, std::int64_t rows, double* wide) {
  for_strip_runs(wide, n, first, rows, block, [](double* to, const double* from, std::int64_t count) { std::copy_n(from, count, to); });
}

}  // namespace

SharedFactoriser::SharedFactoriser(const Plan& plan, Numbers& numbers, const std::vector<std::vector<double>>& blocks)
    : plan_(plan),
      numbers_(numbers),
      blocks_(blocks),
      kernels_(find_factor_kernels()),
      mailbox_(plan.comm, kLetterTag + numbers.generation % 2, {numbers.panels.data(), static_cast<std::size_t>(plan.room.panels)}),
      works_(plan.shared.size()),
      block_(plan.shared.empty() ? 0 : kMaxBlock * kMaxBlock),
      left_(static_cast<int>(plan.shared.size())) {
  for (std::size_t f = 0; f < plan.shared.size(); ++f) {
    shared_of_id_.emplace(plan.shared[f].id, static_cast<std::int32_t>(f));
    for (const SharedChild& child : plan.shared[f].children) {
      works_[f].children.emplace_back(child.arriving.size());
      for (const std::int64_t numbers_there : child.arriving) works_[f].missing += numbers_there > 0 ? 1 : 0;
    }
  }
}

void SharedFactoriser::run(const std::function<void()>& factorise_own) {
  const comm::Communicator comm(plan_.comm);
  try {
    factorise_own();
    work_off();
  } catch (const std::bad_alloc&) {
    has_failed_ = true;
    works_.clear();  // frees memory for messages still to arrive
    for (int rank = 0; rank < comm.size(); ++rank)
      if (rank != comm.rank()) mailbox_.send(rank, Letter({kAbort, 0, 0, 0}, 0));
  }
  drain();
  comm.agree([&] {
    if (has_failed_) throw std::bad_alloc();
  });
}

void SharedFactoriser::work_off() {
  while (left_ > 0 && !has_failed_) {
    while (std::optional<Letter> letter = mailbox_.receive()) take(std::move(*letter));
    mailbox_.release();
    if (has_failed_) break;
    bool has_stepped = false;
    for (std::size_t f = 0; f < works_.size() && !has_stepped; ++f) has_stepped = !works_[f].is_done && step(static_cast<std::int32_t>(f));
    if (!has_stepped) mailbox_.rest(true);
  }
  if (has_failed_) works_.clear();
}

void SharedFactoriser::drain() {
  double extremes[3] = {-numbers_.outcome.smallest, numbers_.outcome.growth, numbers_.outcome.is_complete ? 0.0 : 1.0};
  double all_extremes[3] = {};
  std::int64_t negative = 0;
  MPI_Request requests[2] = {MPI_REQUEST_NULL, MPI_REQUEST_NULL};
  bool is_reducing = false;
  for (int is_over = 0; is_over == 0;) {
    try {
      if (const std::optional<Letter> letter = mailbox_.receive())
        has_failed_ = has_failed_ || letter->heading().kind == kAbort;
      else
        mailbox_.rest(false);
    } catch (const std::bad_alloc&) {
      has_failed_ = true;
    }
    if (!mailbox_.release()) continue;
    if (!is_reducing) {
      MPI_Iallreduce(extremes, all_extremes, 3, MPI_DOUBLE, MPI_MAX, plan_.comm, &requests[0]);
      MPI_Iallreduce(&numbers_.outcome.negative, &negative, 1, MPI_INT64_T, MPI_SUM, plan_.comm, &requests[1]);
      is_reducing = true;
    }
    MPI_Testall(2, requests, &is_over, MPI_STATUSES_IGNORE);
  }
  numbers_.outcome = {negative, -all_extremes[0], all_extremes[1], all_extremes[2] == 0};
}

void SharedFactoriser::take(Letter letter) {
  const Heading heading = letter.heading();
  if (heading.kind == kAbort) {
    has_failed_ = true;
    return;
  }
  const std::int32_t f = shared_of_id_.at(heading.front);
  Work& work = works_[f];
  if (heading.kind == kUpdate) {
    work.children[heading.index][heading.place] = std::move(letter);
    --work.missing;
  } else if (heading.kind == kDiagonal) {
    work.diagonals.emplace(heading.index, std::move(letter));
  } else {
    take_panel(f, std::move(letter));
  }
}

void SharedFactoriser::take_panel(std::int32_t f, Letter letter) {
  const SharedFront& front = plan_.shared[f];
  const Heading heading = letter.heading();
  const int k = heading.index;
  const int n = 3 * front.map.nodes(k);
  Update& update = find_update(front, works_[f], k);
  std::copy_n(letter.numbers(), n, update.pivots.diagonal);
  std::copy_n(letter.numbers() + kMaxBlock, n, update.pivots.off);
  if (front.map.has_whole_columns()) {
    update.letter = std::make_shared<const Letter>(std::move(letter));
    update.wide = update.letter->numbers() + kPivotNumbers;
  } else {
    add_rows(front, update, k, heading.place, letter.numbers() + kPivotNumbers);
  }
  --update.missing;
  complete(front, f, update, k);
}

bool SharedFactoriser::step(std::int32_t f) {
  const SharedFront& front = plan_.shared[f];
  Work& work = works_[f];
  if (!work.is_assembled) {
    if (work.missing > 0) return false;
    assemble(front, work, f);
    return true;
  }
  if (eliminate_lead(front, work, f) || update_next(front, work)) return true;
  if (work.lead < front.map.pivot_tiles() || work.panel < front.map.pivot_tiles()) return false;
  finish(front, work);
  return true;
}

/// Eliminates the next panel in a column of this rank, once all earlier panels have updated it.
bool SharedFactoriser::eliminate_lead(const SharedFront& front, Work& work, std::int32_t f) {
  const int k = work.lead;
  if (k >= front.map.pivot_tiles()) return false;
  const bool has_rows = front.map.has_column(front.place, k) && front.own_nodes() > front.row_begin[k];
  if (!has_rows) {
    ++work.lead;
    return true;
  }
  const bool is_updated =
      work.panel >= k || (work.panel == k - 1 && (work.next >= front.column_tiles.size() || front.column_tiles[work.next] > k));
  if (!is_updated) return false;
  if (front.map.owner(k, k) == front.place) {
    eliminate_diagonal(front, work, f, k);
  } else {
    const auto arrived = work.diagonals.find(k);
    if (arrived == work.diagonals.end()) return false;
    const int n = 3 * front.map.nodes(k);
    const double* numbers = arrived->second.numbers();
    BlockPivots pivots;
    std::copy_n(numbers, n, pivots.diagonal);
    std::copy_n(numbers + n, n, pivots.off);
    for (int c = 0; c < n; ++c) pivots.order[c] = static_cast<int>(numbers[2 * n + c]);
    eliminate_column(front, work, f, k, pivots, numbers + 3 * std::int64_t{n});
    work.diagonals.erase(arrived);
  }
  ++work.lead;
  return true;
}

void SharedFactoriser::eliminate_diagonal(const SharedFront& front, Work& work, std::int32_t f, int k) {
  const int n = 3 * front.map.nodes(k);
  const SharedPanel& panel = numbers_.shared[f][k];
  const std::size_t at = front.find_column_tile(k);
  double* block = block_.data();
  const int first = find_first_row(front, k);
  for (int j = 0; j < n; ++j) {
    const double* column = find_column(front, work, at, j) + first;
    for (int i = j; i < n; ++i) block[j * kMaxBlock + i] = block[i * kMaxBlock + j] = column[i];
  }
  BlockPivots pivots;
  double* triangle = numbers_.panels.data() + panel.triangle;
  numbers_.outcome.eliminate(kernels_, block, n, pivots, triangle);
  std::copy_n(pivots.diagonal, n, numbers_.d_diagonal.begin() + panel.pivots);
  std::copy_n(pivots.off, n, numbers_.d_off.begin() + panel.pivots);
  std::copy_n(pivots.order, n, numbers_.order.begin() + panel.pivots);
  for (const int place : front.column_places[k]) {
    Letter letter({kDiagonal, front.id, front.place, k}, 3 * std::int64_t{n} + count_triangle(n));
    double* to = std::copy_n(pivots.diagonal, n, letter.numbers());
    to = std::copy_n(pivots.off, n, to);
    to = std::copy_n(pivots.order, n, to);
    std::copy_n(triangle, count_triangle(n), to);
    mailbox_.send(front.map.rank(place), std::move(letter));
  }
  eliminate_column(front, work, f, k, pivots, triangle);
}

void SharedFactoriser::eliminate_column(const SharedFront& front, Work& work, std::int32_t f, int k, const BlockPivots& pivots,
                                        const double* triangle) {
  const int begin = find_first_row(front, k + 1);
  const int end = 3 * front.own_nodes();
  if (begin == end) return;
  const int n = 3 * front.map.nodes(k);
  Update* update = front.is_updated(front.place, k) ? &find_update(front, work, k) : nullptr;
  const bool is_whole = front.map.has_whole_columns();
  std::shared_ptr<Letter> letter;
  Buffer scratch;
  double* wide = nullptr;
  if (is_whole) {
    letter = std::make_shared<Letter>(Heading{kPanel, front.id, front.place, k}, kPivotNumbers + count_strips(end - begin) * n);
    wide = letter->numbers() + kPivotNumbers;
  } else if (update != nullptr) {
    wide = update->rows.data();
  } else {
    scratch = Buffer(count_strips(end - begin) * n);
    wide = scratch.data();
  }
  const std::size_t at = front.find_column_tile(k);
  const double* columns[kMaxBlock];
  for (int c = 0; c < n; ++c) columns[c] = find_column(front, work, at, pivots.order[c]);
  kernels_.trsm(columns, begin, end, n, triangle, wide);
  if (is_whole) {
    std::copy_n(pivots.diagonal, n, letter->numbers());
    std::copy_n(pivots.off, n, letter->numbers() + kMaxBlock);
  }
  send_rows(front, k, pivots, letter, wide);
  double* tiles = numbers_.panels.data() + numbers_.shared[f][k].tiles;
  kernels_.scale_by_d_inverse(wide, 0, end - begin, n, pivots, tiles, numbers_.outcome.growth);
  if (update == nullptr) return;
  update->pivots = pivots;
  update->wide = wide;
  update->letter = letter;
  --update->missing;
  complete(front, f, *update, k);
}

/// Sends W to the ranks that need it for their rows or columns.
void SharedFactoriser::send_rows(const SharedFront& front, int k, const BlockPivots& pivots, const std::shared_ptr<const Letter>& letter,
                                 const double* wide) {
  const int n = 3 * front.map.nodes(k);
  const int begin = find_first_row(front, k + 1);
  for (int place = 0; place < front.map.places(); ++place) {
    if (place == front.place || !front.is_updated(place, k)) continue;
    if (letter != nullptr) {
      mailbox_.send(front.map.rank(place), letter);
      continue;
    }
    std::int64_t rows = 0;
    front.map.for_needed(k, front.place, place, [&](int i) { rows += 3 * front.map.nodes(i); });
    if (rows == 0) continue;
    Letter part({kPanel, front.id, front.place, k}, kPivotNumbers + rows * n);
    std::copy_n(pivots.diagonal, n, part.numbers());
    std::copy_n(pivots.off, n, part.numbers() + kMaxBlock);
    double* to = part.numbers() + kPivotNumbers;
    front.map.for_needed(k, front.place, place, [&](int i) {
      const std::int64_t height = 3 * std::int64_t{front.map.nodes(i)};
      copy_from_strips(wide, n, find_first_row(front, i) - begin, height, to);
      to += height * n;
    });
    mailbox_.send(front.map.rank(place), std::move(part));
  }
}

SharedFactoriser::Update& SharedFactoriser::find_update(const SharedFront& front, Work& work, int k) {
  const auto [at, is_new] = work.updates.try_emplace(k);
  Update& update = at->second;
  if (!is_new) return update;
  const std::int64_t n = 3 * std::int64_t{front.map.nodes(k)};
  if (!front.map.has_whole_columns()) {
    std::int64_t columns = 0;
    for (const int j : front.column_tiles)
      if (j > k && !front.map.has_row(front.place, j)) columns += 3 * front.map.nodes(j);
    update.rows = Buffer(count_strips(3 * front.own_nodes() - find_first_row(front, k + 1)) * n);
    update.columns = Buffer(count_strips(columns) * n);
    update.wide = update.rows.data();
  }
  for (int place = 0; place < front.map.places(); ++place) {
    if (!front.map.has_column(place, k)) continue;
    bool has_rows = false;
    front.map.for_needed(k, place, front.place, [&](int) { has_rows = true; });
    update.missing += has_rows ? 1 : 0;
  }
  return update;
}

/// Copies received rows into the strips of this rank's rows and columns.
void SharedFactoriser::add_rows(const SharedFront& front, Update& update, int k, int from, const double* rows) {
  const int n = 3 * front.map.nodes(k);
  front.map.for_needed(k, from, front.place, [&](int i) {
    const std::int64_t height = 3 * std::int64_t{front.map.nodes(i)};
    if (front.map.has_row(front.place, i))
      copy_to_strips(rows, n, find_first_row(front, i) - find_first_row(front, k + 1), height, update.rows.data());
    else if (front.map.has_column(front.place, i)) {
      std::int64_t offset = 0;
      for (const int j : front.column_tiles)
        if (j > k && j < i && !front.map.has_row(front.place, j)) offset += 3 * front.map.nodes(j);
      copy_to_strips(rows, n, offset, height, update.columns.data());
    }
    rows += height * n;
  });
}

/// Computes L of this rank's columns once all rows have arrived.
void SharedFactoriser::complete(const SharedFront& front, std::int32_t f, Update& update, int k) {
  if (update.missing > 0) return;
  const int n = 3 * front.map.nodes(k);
  const int first = find_first_row(front, k + 1);
  const double* own = numbers_.find_tiles(numbers_.shared[f][k]);
  std::int64_t made = 0;
  for (const int j : front.column_tiles)
    if (j > k && front.map.owner(j, k) != front.place) made += 3 * front.map.nodes(j);
  update.tiles = Buffer(made * n);
  double* tiles = update.tiles.data();
  int apart = 0;  // rows in update.columns
  double growth = 0;
  for (const int j : front.column_tiles) {
    const double*& found = update.tiles_of_column.emplace_back(nullptr);
    if (j <= k) continue;
    const int rows = 3 * front.map.nodes(j);
    if (front.map.owner(j, k) == front.place) {
      found = own + std::int64_t{find_first_row(front, j) - first} * n;
      continue;
    }
    const bool is_among_rows = front.map.has_row(front.place, j);
    kernels_.scale_by_d_inverse(is_among_rows ? update.wide : update.columns.data(),
                                is_among_rows ? find_first_row(front, j) - first : apart, rows, n, update.pivots, tiles, growth);
    if (!is_among_rows) apart += rows;
    found = tiles;
    tiles += std::int64_t{rows} * n;
  }
  update.columns = Buffer();
  update.is_ready = true;
}

/// Updates the next tile column by the current panel.
bool SharedFactoriser::update_next(const SharedFront& front, Work& work) {
  const int k = work.panel;
  if (k >= front.map.pivot_tiles()) return false;
  const auto pass = [&] {
    work.updates.erase(k);
    ++work.panel;
    work.next = std::upper_bound(front.column_tiles.begin(), front.column_tiles.end(), work.panel) - front.column_tiles.begin();
    return true;
  };
  if (!front.is_updated(front.place, k)) return work.lead > k && pass();
  const auto update = work.updates.find(k);
  if (update == work.updates.end() || !update->second.is_ready) return false;
  if (work.next >= front.column_tiles.size()) return work.lead > k && pass();
  const int j = front.column_tiles[work.next];
  const int first = find_first_row(front, k + 1);
  const int begin = find_first_row(front, j) - first;
  const int end = 3 * front.own_nodes() - first;
  if (begin < end) {
    const int n = 3 * front.map.nodes(k);
    double* columns[kMaxBlock];
    const int width = 3 * front.map.nodes(j);
    for (int c = 0; c < width; ++c) columns[c] = find_column(front, work, work.next, c) + first;
    kernels_.update_columns(update->second.tiles_of_column[work.next], width, update->second.wide, begin, end, n, columns);
  }
  ++work.next;
  return true;
}

double* SharedFactoriser::find_column(const SharedFront& front, const Work& work, std::size_t at, std::int32_t column) {
  const int j = front.column_tiles[at];
  const std::int64_t height = 3 * std::int64_t{front.own_nodes()} - find_first_row(front, j);
  return work.columns[at] + column * height - find_first_row(front, j);
}

template <typename FindPieceRows>
void SharedFactoriser::add_update(const SharedFront& front, Work& work, const SharedChild& child, int from, FindPieceRows&& find_rows) {
  // Runs of rows consecutive in the parent front too.
  struct TileRun {
    std::int64_t begin, end;  // rows of the child
    std::int64_t to;          // row of the tile
  };
  std::vector<TileRun> runs;
  for_pieces(child, from, front.map, front.place, [&](const Piece& piece) {
    const std::int32_t* nodes = child.node_of_row.data();
    const int j = front.map.find_tile(nodes[piece.b_begin]);
    const int i = front.map.find_tile(nodes[piece.a_begin]);
    const std::size_t at = front.find_column_tile(j);
    runs.clear();
    for (std::int32_t a = piece.a_begin; a < piece.a_end; ++a) {
      if (runs.empty() || nodes[a] != nodes[a - 1] + 1)
        runs.push_back({3 * std::int64_t{a}, 0, 3 * std::int64_t{nodes[a] - front.map.start(i)}});
      runs.back().end = 3 * (std::int64_t{a} + 1);
    }
    for (std::int64_t c = 3 * std::int64_t{piece.b_begin}; c < 3 * std::int64_t{piece.b_end}; ++c) {
      const std::int32_t within = 3 * (nodes[c / 3] - front.map.start(j)) + static_cast<std::int32_t>(c % 3);
      double* column = find_column(front, work, at, within) + find_first_row(front, i);
      const std::int64_t first = piece.find_first_row(c);
      const double* numbers = find_rows(piece, c);
      for (const TileRun& run : runs) {
        const std::int64_t begin = std::max(run.begin, first);
        const std::int64_t count = run.end - begin;
        if (count <= 0) continue;
        double* __restrict__ to = column + run.to + (begin - run.begin);
        const double* __restrict__ rows = numbers + (begin - first);
        for (std::int64_t r = 0; r < count; ++r) to[r] += rows[r];
      }
    }
  });
}

void SharedFactoriser::assemble(const SharedFront& front, Work& work, std::int32_t f) {
  double* const pivots = numbers_.panels.data() + numbers_.shared_columns[f];
  std::fill_n(pivots, front.count_pivot_columns(), 0.0);
  const auto place = [&](auto first, auto last, double* at) {
    for (; first != last; ++first) {
      work.columns.push_back(at);
      at += front.count_column(*first);
    }
  };
  const auto end = front.column_tiles.end();
  auto first = std::lower_bound(front.column_tiles.begin(), end, front.map.pivot_tiles());
  place(front.column_tiles.begin(), first, pivots);
  while (first != end) {
    std::int64_t numbers = 0;
    auto last = first;
    for (; last != end && numbers < kPieceNumbers; ++last) numbers += front.count_column(*last);
    place(first, last, work.tiles.emplace_back(Buffer::make_zero(numbers)).data());
    first = last;
  }
  const auto find = [&](std::int32_t column, std::int32_t row) {
    const int j = front.map.find_tile(column);
    const int i = front.map.find_tile(row);
    const std::size_t at = front.find_column_tile(j);
    return find_column(front, work, at, 3 * (column - front.map.start(j))) + find_first_row(front, i) + 3 * (row - front.map.start(i));
  };
  const auto height = [&](std::int32_t column) {
    return 3 * std::int64_t{front.own_nodes()} - find_first_row(front, front.map.find_tile(column));
  };
  for (std::size_t l = 0; l < plan_.received.size(); ++l) {
    const std::vector<ReceivedBlocks::Shared>& list = plan_.received[l].shared;
    auto at = std::lower_bound(list.begin(), list.end(), f,
                               [](const ReceivedBlocks::Shared& one, std::int32_t front_at) { return one.front < front_at; });
    for (; at != list.end() && at->front == f; ++at) {
      if (at->row < 0) continue;
      const double* block = blocks_[l].data() + 9 * (plan_.received[l].columns.size() + static_cast<std::size_t>(at - list.begin()));
      double* to = find(at->column, at->row);
      for (int d = 0; d < 3; ++d)
        for (int e = 0; e < 3; ++e) to[d * height(at->column) + e] += block[3 * d + e];
    }
  }
  for (std::size_t c = 0; c < front.children.size(); ++c) {
    const SharedChild& child = front.children[c];
    for (std::size_t from = 0; from < work.children[c].size(); ++from) {
      if (child.arriving[from] == 0) continue;
      const double* next = work.children[c][from].numbers();
      add_update(front, work, child, static_cast<int>(from), [&](const Piece& piece, std::int64_t column) {
        const double* rows = next;
        next += 3 * std::int64_t{piece.a_end} - piece.find_first_row(column);
        return rows;
      });
      work.children[c][from] = Letter();
    }
  }
  work.is_assembled = true;
  work.next =
      static_cast<std::size_t>(std::upper_bound(front.column_tiles.begin(), front.column_tiles.end(), 0) - front.column_tiles.begin());
}

void SharedFactoriser::send_update(std::int32_t parent, std::int32_t child, int from, const FindRows& find) {
  const SharedFront& above = plan_.shared[parent];
  const SharedChild& below = above.children[child];
  for (int to = 0; to < above.map.places(); ++to) {
    std::int64_t count = 0;
    for_pieces(below, from, above.map, to, [&](const Piece& piece) { count += piece.count(); });
    if (count == 0) continue;
    Letter letter({kUpdate, above.id, from, child}, count);
    double* next = letter.numbers();
    for_pieces(below, from, above.map, to, [&](const Piece& piece) {
      for (std::int64_t c = 3 * std::int64_t{piece.b_begin}; c < 3 * std::int64_t{piece.b_end}; ++c) {
        const std::int64_t row = piece.find_first_row(c);
        next = std::copy_n(find(piece.a_begin, c) + (row - 3 * std::int64_t{piece.a_begin}), 3 * std::int64_t{piece.a_end} - row, next);
      }
    });
    if (to == above.place)
      take(std::move(letter));
    else
      mailbox_.send(above.map.rank(to), std::move(letter));
  }
}

void SharedFactoriser::finish(const SharedFront& front, Work& work) {
  if (front.parent >= 0 && front.last_columns[front.place] >= front.map.pivot_tiles()) {
    const auto find = [&](std::int32_t a, std::int64_t c) {
      const std::int32_t row = front.width + a;
      const auto column = static_cast<std::int32_t>(front.width + c / 3);
      const int i = front.map.find_tile(row);
      const int j = front.map.find_tile(column);
      const std::int64_t within = 3 * std::int64_t{column - front.map.start(j)} + c % 3;
      return find_column(front, work, front.find_column_tile(j), within) + find_first_row(front, i) + 3 * (row - front.map.start(i));
    };
    send_update(front.parent, front.place_in_parent, front.place, find);
  }
  work = Work();
  work.is_done = true;
  --left_;
}

}  // namespace carillon::ldlt

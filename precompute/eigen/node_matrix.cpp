// Method:     Compressed rows of node blocks; sixteen right-hand sides in row-major order, so that every product with an entry is a vector
//             operation and a node's values are one stretch of memory.
// Source:     Im, Yelick, Vuduc, Sparsity: optimization framework for sparse matrix kernels, 2004 (register blocks, multiple vectors).
// Deviations: none.
#include "precompute/eigen/node_matrix.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr int kStrip = NodeMatrix::kStrip;
#if defined(__x86_64__)
#define CARILLON_CLONES __attribute__((target_clones("avx512f", "arch=haswell", "default")))
#else
#define CARILLON_CLONES
#endif

// One row of nodes: y (3 x 16) = sum of blocks (3 x 3) times x (3 x 16).
CARILLON_CLONES void multiply_blocks(const std::int64_t* start, const std::int32_t* neighbour, const double* values, std::size_t nodes,
                                     const double* x, double* y) {
  for (std::size_t node = 0; node < nodes; ++node) {
    double sum[3][kStrip] = {};
    for (std::int64_t k = start[node]; k < start[node + 1]; ++k) {
      const double* a = values + 9 * k;
      const double* from = x + static_cast<std::ptrdiff_t>(neighbour[k]) * 3 * kStrip;
      for (int c = 0; c < kStrip; ++c) {
        sum[0][c] += a[0] * from[c] + a[1] * from[kStrip + c] + a[2] * from[2 * kStrip + c];
        sum[1][c] += a[3] * from[c] + a[4] * from[kStrip + c] + a[5] * from[2 * kStrip + c];
        sum[2][c] += a[6] * from[c] + a[7] * from[kStrip + c] + a[8] * from[2 * kStrip + c];
      }
    }
    for (int d = 0; d < 3; ++d) {
      for (int c = 0; c < kStrip; ++c) y[(node * 3 + static_cast<std::size_t>(d)) * kStrip + static_cast<std::size_t>(c)] = sum[d][c];
    }
  }
}

CARILLON_CLONES void multiply_scalars(const std::int64_t* start, const std::int32_t* neighbour, const double* values, std::size_t nodes,
                                      const double* x, double* y) {
  for (std::size_t node = 0; node < nodes; ++node) {
    double sum[3 * kStrip] = {};
    for (std::int64_t k = start[node]; k < start[node + 1]; ++k) {
      const double a = values[k];
      const double* from = x + static_cast<std::ptrdiff_t>(neighbour[k]) * 3 * kStrip;
      for (int c = 0; c < 3 * kStrip; ++c) sum[c] += a * from[c];
    }
    for (int c = 0; c < 3 * kStrip; ++c) y[node * 3 * kStrip + static_cast<std::size_t>(c)] = sum[c];
  }
}

// Rows first ... of up to sixteen columns to row-major order and back; columns beyond x.count are zero.
void to_row_major(const Columns& x, int first, double* out) {
  const int count = std::min(kStrip, x.count - first);
  if (count < kStrip) std::fill(out, out + x.rows * kStrip, 0.0);
  constexpr std::ptrdiff_t kRows = 64;
  for (std::ptrdiff_t r = 0; r < x.rows; r += kRows) {
    const std::ptrdiff_t last = std::min(r + kRows, x.rows);
    for (int c = 0; c < count; ++c) {
      const double* column = x.column(first + c);
      for (std::ptrdiff_t i = r; i < last; ++i) out[i * kStrip + c] = column[i];
    }
  }
}

void from_row_major(const double* in, const Columns& y, int first) {
  const int count = std::min(kStrip, y.count - first);
  constexpr std::ptrdiff_t kRows = 64;
  for (std::ptrdiff_t r = 0; r < y.rows; r += kRows) {
    const std::ptrdiff_t last = std::min(r + kRows, y.rows);
    for (int c = 0; c < count; ++c) {
      double* column = y.column(first + c);
      for (std::ptrdiff_t i = r; i < last; ++i) column[i] = in[i * kStrip + c];
    }
  }
}

struct Block {
  PetscInt node = 0;
  std::array<double, 9> values{};
};

// Three rows of a node as blocks, ascending by node. The rows of an elastic body share their pattern, so inserting is rare.
void read_node_row(Mat matrix, PetscInt row, std::vector<Block>& blocks) {
  blocks.clear();
  for (PetscInt d = 0; d < 3; ++d) {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    check(MatGetRow(matrix, row + d, &count, &columns, &values));
    std::size_t at = 0;
    for (PetscInt k = 0; k < count; ++k) {
      const PetscInt node = columns[k] / 3;
      while (at < blocks.size() && blocks[at].node < node) ++at;
      if (at == blocks.size() || blocks[at].node != node) blocks.insert(blocks.begin() + static_cast<std::ptrdiff_t>(at), Block{node, {}});
      blocks[at].values[static_cast<std::size_t>(3 * d + columns[k] % 3)] = values[k];
    }
    check(MatRestoreRow(matrix, row + d, &count, &columns, &values));
  }
}

bool is_scalar(const std::array<double, 9>& block) {
  for (const std::size_t i : {1, 2, 3, 5, 6, 7}) {
    if (block[i] != 0) return false;
  }
  return block[0] == block[4] && block[0] == block[8];
}

bool is_diagonal_block(const std::array<double, 9>& block) {
  return std::all_of(block.begin(), block.end(), [&](const double& v) { return v == 0 || (&v - block.data()) % 4 == 0; });
}

}  // namespace

NodeMatrix::NodeMatrix(Mat matrix) { read(matrix); }

void NodeMatrix::read(Mat matrix) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(matrix), &comm));
  PetscInt first = 0;
  PetscInt last = 0;
  check(MatGetOwnershipRange(matrix, &first, &last));
  nodes_ = static_cast<std::size_t>((last - first) / 3);
  bool only_diagonal = true;
  bool only_scalars = true;
  std::vector<PetscInt> global;
  start_.push_back(0);
  std::vector<Block> blocks;
  for (PetscInt row = first; row < last; row += 3) {
    read_node_row(matrix, row, blocks);
    for (const auto& [node, block] : blocks) {
      if (std::all_of(block.begin(), block.end(), [](double v) { return v == 0; })) continue;
      only_diagonal = only_diagonal && 3 * node == row && is_diagonal_block(block);
      only_scalars = only_scalars && is_scalar(block);
      global.push_back(node);
      values_.insert(values_.end(), block.begin(), block.end());
    }
    start_.push_back(static_cast<std::int64_t>(global.size()));
  }
  kind_ = petsc::all_ok(comm, only_diagonal) ? Kind::kDiagonal : petsc::all_ok(comm, only_scalars) ? Kind::kScalars : Kind::kBlocks;
  if (kind_ == Kind::kDiagonal) {
    diagonal_.assign(3 * nodes_, 0.0);
    for (std::size_t node = 0; node < nodes_; ++node) {
      if (start_[node] == start_[node + 1]) continue;
      for (std::size_t d = 0; d < 3; ++d) diagonal_[3 * node + d] = values_[9 * static_cast<std::size_t>(start_[node]) + 4 * d];
    }
    start_ = {};
    values_ = {};
    return;
  }
  if (kind_ == Kind::kScalars) {
    for (std::size_t k = 0; k < global.size(); ++k) values_[k] = values_[9 * k];
    values_.resize(global.size());
    values_.shrink_to_fit();
  }
  const PetscInt first_node = first / 3;
  std::vector<PetscInt> ghosts;
  for (const PetscInt node : global) {
    if (node < first_node || node >= last / 3) ghosts.push_back(node);
  }
  std::sort(ghosts.begin(), ghosts.end());
  ghosts.erase(std::unique(ghosts.begin(), ghosts.end()), ghosts.end());
  ghosts_ = ghosts.size();
  for (const PetscInt node : global) {
    if (node >= first_node && node < last / 3) {
      neighbour_.push_back(static_cast<std::int32_t>(node - first_node));
    } else {
      const auto at = std::lower_bound(ghosts.begin(), ghosts.end(), node) - ghosts.begin();
      neighbour_.push_back(static_cast<std::int32_t>(nodes_) + static_cast<std::int32_t>(at));
    }
  }
  plan_exchange(matrix, ghosts);
}

void NodeMatrix::plan_exchange(Mat matrix, const std::vector<PetscInt>& ghosts) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(matrix), &comm));
  int size = 1;
  MPI_Comm_size(comm, &size);
  if (size == 1) return;
  const PetscInt* ranges = nullptr;
  check(MatGetOwnershipRanges(matrix, &ranges));
  std::vector<PetscSFNode> remote(ghosts.size());
  for (std::size_t i = 0; i < ghosts.size(); ++i) {
    const PetscInt row = 3 * ghosts[i];
    const auto owner = std::upper_bound(ranges, ranges + size + 1, row) - ranges - 1;
    remote[i].rank = static_cast<PetscInt>(owner);
    remote[i].index = (row - ranges[owner]) / 3;
  }
  check(PetscSFCreate(comm, exchange_.out()));
  check(PetscSFSetGraph(exchange_, static_cast<PetscInt>(nodes_), static_cast<PetscInt>(ghosts.size()), nullptr, PETSC_COPY_VALUES,
                        remote.data(), PETSC_COPY_VALUES));
  check(PetscSFSetUp(exchange_));
}

void NodeMatrix::multiply_strip(const double* x, double* y) const {
  const auto multiply = kind_ == Kind::kScalars ? multiply_scalars : multiply_blocks;
  multiply(start_.data(), neighbour_.data(), values_.data(), nodes_, x, y);
}

void NodeMatrix::multiply(const Columns& x, const Columns& y) const {
  if (kind_ == Kind::kDiagonal) {
    for (int j = 0; j < x.count; ++j) {
      const double* from = x.column(j);
      double* to = y.column(j);
      for (std::ptrdiff_t i = 0; i < x.rows; ++i) to[i] = diagonal_[static_cast<std::size_t>(i)] * from[i];
    }
    return;
  }
  constexpr std::size_t kPerNode = 3 * kStrip;
  std::vector<double> in((nodes_ + ghosts_) * kPerNode);
  std::vector<double> out(nodes_ * kPerNode);
  MPI_Datatype node_values = MPI_DATATYPE_NULL;
  if (exchange_.get() != nullptr) {
    MPI_Type_contiguous(static_cast<int>(kPerNode), MPI_DOUBLE, &node_values);
    MPI_Type_commit(&node_values);
  }
  for (int first = 0; first < x.count; first += kStrip) {
    to_row_major(x, first, in.data());
    if (exchange_.get() != nullptr) {
      double* ghosts = in.data() + nodes_ * kPerNode;
      check(PetscSFBcastBegin(exchange_, node_values, in.data(), ghosts, MPI_REPLACE));
      check(PetscSFBcastEnd(exchange_, node_values, in.data(), ghosts, MPI_REPLACE));
    }
    multiply_strip(in.data(), out.data());
    from_row_major(out.data(), y, first);
  }
  if (exchange_.get() != nullptr) MPI_Type_free(&node_values);
}

}  // namespace carillon::eigen

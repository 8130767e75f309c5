// Method: Compressed rows of node blocks; sixteen right-hand sides in row-major order, so that every product with an entry is a vector
// operation and the values of a node are contiguous. A matrix of blocks is treated as a stiffness, which depends on differences of
// displacement only: y_i = sum_j K_ij (x_j - x_i) + (sum_j K_ij) x_i, where the last sum is zero up to rounding unless the node has a fixed
// neighbour. In this form the rounding of K and of the product is relative to the differences, so nearly rigid motions, the low modes of
// thin bodies, keep their digits.
// Source: Im, Yelick, Vuduc, Sparsity: optimization framework for sparse matrix kernels, 2004 (register blocks, multiple vectors).
#include "precompute/la/node_matrix.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "precompute/la/node_products.hpp"
#include "precompute/la/node_rows.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"

namespace carillon::la {
namespace {

using petsc::check;

constexpr int kStrip = NodeMatrix::kStrip;
using Row = NodeMatrix::Row;
constexpr std::size_t kNodes = 32;  // unpacked at a time, while their products are in the first-level cache

// At most sixteen columns.
void to_rows(const Columns& x, Row* out) {
  constexpr std::ptrdiff_t kRows = 64;
  for (std::ptrdiff_t r = 0; r < x.rows; r += kRows) {
    const std::ptrdiff_t last = std::min(r + kRows, x.rows);
    for (int c = 0; c < kStrip; ++c) {
      if (c < x.count) {
        const double* column = x.column(c);
        for (std::ptrdiff_t i = r; i < last; ++i) out[i].column[c] = column[i];
      } else {
        for (std::ptrdiff_t i = r; i < last; ++i) out[i].column[c] = 0;
      }
    }
  }
}

/// Packed columns of a product, 128 bytes per row of the rank, shared by all matrices and kept until the process ends: fresh memory for
/// each product costs as much as the product.
std::vector<Row>& get_strip() {
  static thread_local std::vector<Row> strip;
  return strip;
}

struct Block {
  PetscInt node = 0;
  std::array<double, 9> values{};
};

/// Three rows of an own node as blocks, ascending by the global number of the other node.
class NodeRow {
 public:
  explicit NodeRow(const NodeRows& rows) : rows_(rows), first_(rows.first_row() / 3) {}

  const std::vector<Block>& read(PetscInt node, double factor) {
    blocks_.clear();
    for (PetscInt d = 0; d < 3; ++d) {
      std::size_t at = 0;
      const auto add = [&](PetscInt other, PetscInt column, double value) {
        while (at < blocks_.size() && blocks_[at].node < other) ++at;
        if (at == blocks_.size() || blocks_[at].node != other)
          blocks_.insert(blocks_.begin() + static_cast<std::ptrdiff_t>(at), Block{other, {}});
        blocks_[at].values[3 * d + column % 3] = factor * value;
      };
      bool is_own = true;  // columns of other ranks follow the own ones, in ascending order
      rows_.visit(
          3 * node + d, [&](PetscInt column, double value) { add(first_ + column / 3, column, value); },
          [&](PetscInt ghost, double value) {
            if (std::exchange(is_own, false)) at = 0;
            add(rows_.ghosts()[ghost] / 3, rows_.ghosts()[ghost], value);
          });
    }
    return blocks_;
  }

 private:
  const NodeRows& rows_;
  PetscInt first_;  // first own node
  std::vector<Block> blocks_;
};

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

NodeMatrix::NodeMatrix(Mat matrix, double factor) { read(matrix, factor); }

void NodeMatrix::read(Mat matrix, double factor) {
  const comm::Communicator comm = petsc::get_communicator(matrix);
  const NodeRows rows(matrix);
  const PetscInt first_node = rows.first_row() / 3;
  nodes_ = rows.rows() / 3;
  bool only_diagonal = true;
  bool only_scalars = true;  // then one value per block is stored
  std::vector<PetscInt> global;
  start_.reserve(nodes_ + 1);
  start_.push_back(0);
  NodeRow node_row(rows);
  MatInfo info;
  check(MatGetInfo(matrix, MAT_LOCAL, &info));
  const std::size_t entries = info.nz_used;  // three for a scalar block, nine for a full one
  global.reserve(entries / 3);
  values_.reserve(entries / 3);
  const auto keep_blocks = [&] {
    if (!std::exchange(only_scalars, false)) return;
    std::vector<double> scalars;
    scalars.swap(values_);
    values_.reserve(entries);
    for (const double value : scalars) values_.insert(values_.end(), {value, 0, 0, 0, value, 0, 0, 0, value});
  };
  for (PetscInt own = 0; own < static_cast<PetscInt>(nodes_); ++own) {
    for (const auto& [node, block] : node_row.read(own, factor)) {
      if (std::all_of(block.begin(), block.end(), [](double v) { return v == 0; })) continue;
      only_diagonal = only_diagonal && node == first_node + own && is_diagonal_block(block);
      if (!is_scalar(block)) keep_blocks();
      global.push_back(node);
      values_.insert(values_.end(), block.begin(), only_scalars ? block.begin() + 1 : block.end());
    }
    start_.push_back(static_cast<std::int64_t>(global.size()));
  }
  kind_ = comm::Communicator(comm).all(only_diagonal)  ? Kind::kDiagonal
          : comm::Communicator(comm).all(only_scalars) ? Kind::kScalars
                                                       : Kind::kBlocks;
  if (kind_ != Kind::kScalars) keep_blocks();
  if (kind_ == Kind::kDiagonal) {
    diagonal_.assign(3 * nodes_, 0.0);
    for (std::size_t node = 0; node < nodes_; ++node) {
      if (start_[node] == start_[node + 1]) continue;
      for (std::size_t d = 0; d < 3; ++d) diagonal_[3 * node + d] = values_[9 * start_[node] + 4 * d];
    }
    start_ = {};
    values_ = {};
    return;
  }
  if (kind_ == Kind::kBlocks) sum_rows();
  const PetscInt last_node = first_node + static_cast<PetscInt>(nodes_);
  std::vector<PetscInt> ghosts;
  for (const PetscInt node : global) {
    if (node < first_node || node >= last_node) ghosts.push_back(node);
  }
  std::sort(ghosts.begin(), ghosts.end());
  ghosts.erase(std::unique(ghosts.begin(), ghosts.end()), ghosts.end());
  ghosts_ = ghosts.size();
  neighbour_.reserve(global.size() + kAhead);
  for (const PetscInt node : global) {
    if (node >= first_node && node < last_node) {
      neighbour_.push_back(static_cast<std::int32_t>(node - first_node));
    } else {
      const auto at = std::lower_bound(ghosts.begin(), ghosts.end(), node) - ghosts.begin();
      neighbour_.push_back(static_cast<std::int32_t>(nodes_) + static_cast<std::int32_t>(at));
    }
  }
  neighbour_.resize(neighbour_.size() + kAhead, 0);  // padding, see multiply_blocks
  plan_exchange(matrix, ghosts);
}

void NodeMatrix::sum_rows() {
  constexpr long double kRoundings = 256 * std::numeric_limits<double>::epsilon();  // a node has some tens of elements
  rest_.assign(9 * nodes_, 0.0);
  for (std::size_t node = 0; node < nodes_; ++node) {
    std::array<long double, 9> sum{};
    long double size = 0;
    for (auto k = static_cast<std::size_t>(start_[node]); k < static_cast<std::size_t>(start_[node + 1]); ++k)
      for (std::size_t i = 0; i < 9; ++i) {
        sum[i] += values_[9 * k + i];
        size = std::max(size, std::abs(static_cast<long double>(values_[9 * k + i])));
      }
    for (std::size_t i = 0; i < 9; ++i)
      if (std::abs(sum[i]) > kRoundings * size) rest_[9 * node + i] = static_cast<double>(sum[i]);
  }
}

void NodeMatrix::plan_exchange(Mat matrix, const std::vector<PetscInt>& ghosts) {
  const comm::Communicator comm = petsc::get_communicator(matrix);
  if (comm.size() == 1) return;
  const PetscInt* ranges = nullptr;
  check(MatGetOwnershipRanges(matrix, &ranges));
  std::vector<PetscSFNode> remote(ghosts.size());
  for (std::size_t i = 0; i < ghosts.size(); ++i) {
    const PetscInt row = 3 * ghosts[i];
    const auto owner = std::upper_bound(ranges, ranges + comm.size() + 1, row) - ranges - 1;
    remote[i].rank = static_cast<PetscInt>(owner);
    remote[i].index = (row - ranges[owner]) / 3;
  }
  check(PetscSFCreate(comm, exchange_.out()));
  check(PetscSFSetGraph(exchange_, static_cast<PetscInt>(nodes_), static_cast<PetscInt>(ghosts.size()), nullptr, PETSC_COPY_VALUES,
                        remote.data(), PETSC_COPY_VALUES));
  check(PetscSFSetUp(exchange_));
}

void NodeMatrix::pack(const Columns& x, int first, std::vector<Row>& packed) const {
  // Each packed strip is multiplied once.
  if (kind_ != Kind::kDiagonal)
    petsc::add_flops((kind_ == Kind::kScalars ? 6.0 : 18.0) * kStrip * static_cast<double>(neighbour_.size() - kAhead));
  packed.resize(3 * (nodes_ + ghosts_));
  to_rows(x.part(first, std::min(kStrip, x.count - first)), packed.data());
  if (exchange_.get() == nullptr) return;
  MPI_Datatype node_values = MPI_DATATYPE_NULL;
  MPI_Type_contiguous(3 * kStrip, MPI_DOUBLE, &node_values);
  MPI_Type_commit(&node_values);
  Row* ghosts = packed.data() + 3 * nodes_;
  check(PetscSFBcastBegin(exchange_, node_values, packed.data(), ghosts, MPI_REPLACE));
  check(PetscSFBcastEnd(exchange_, node_values, packed.data(), ghosts, MPI_REPLACE));
  MPI_Type_free(&node_values);
}

void NodeMatrix::multiply_rows(const Row* packed, std::size_t begin, std::size_t nodes, Row* y) const {
  if (kind_ == Kind::kDiagonal) {
    for (std::size_t i = 0; i < 3 * nodes; ++i) {
      const double by = diagonal_[3 * begin + i];
      for (std::size_t c = 0; c < kStrip; ++c) y[i].column[c] = by * packed[3 * begin + i].column[c];
    }
    return;
  }
  if (kind_ == Kind::kScalars) return multiply_scalars(start_.data() + begin, neighbour_.data(), values_.data(), nodes, packed, y);
  multiply_blocks(start_.data() + begin, neighbour_.data(), values_.data(), rest_.data() + 9 * begin, nodes, packed + 3 * begin, packed, y);
}

void NodeMatrix::unpack(const Row* rows, std::size_t begin, std::size_t nodes, const Columns& y) {
  for (int c = 0; c < y.count; ++c) {
    double* column = y.column(c) + 3 * begin;
    for (std::size_t i = 0; i < 3 * nodes; ++i) column[i] = rows[i].column[c];
  }
}

void NodeMatrix::multiply(const Columns& x, const Columns& y) const {
  if (kind_ == Kind::kDiagonal) {
    for (int j = 0; j < x.count; ++j) {
      const double* from = x.column(j);
      double* to = y.column(j);
      for (std::ptrdiff_t i = 0; i < x.rows; ++i) to[i] = diagonal_[i] * from[i];
    }
    return;
  }
  std::vector<Row>& packed = get_strip();
  Row rows[3 * kNodes];
  for (int first = 0; first < x.count; first += kStrip) {
    pack(x, first, packed);
    const Columns part = y.part(first, std::min(kStrip, x.count - first));
    for (std::size_t node = 0; node < nodes_; node += kNodes) {
      const std::size_t count = std::min(kNodes, nodes_ - node);
      multiply_rows(packed.data(), node, count, rows);
      unpack(rows, node, count, part);
    }
  }
}

}  // namespace carillon::la

// Rows located where they are eliminated, on any number of ranks.
#include "precompute/ldlt/mesh_order.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "precompute/comm/communicator.hpp"
#include "precompute/ldlt/numeric.hpp"
#include "precompute/ldlt/plan.hpp"
#include "precompute/ldlt/storage.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/precompute/ldlt/pencil.hpp"

namespace carillon::ldlt {
namespace {

using comm::Communicator;
using comm::IndexPartition;
using test::Pencil;

/// A lattice whose springs are elements of two nodes, distributed over the ranks in turn.
class OrderedLattice {
 public:
  OrderedLattice(int nx, int ny, int nz, int copies)
      : comm_(PETSC_COMM_WORLD),
        pencil_(test::make_lattice(nx, ny, nz, copies, test::MassKind::kDiagonal, 5)),
        nodes_(static_cast<std::int32_t>(pencil_.dense_k.rows() / 3)),
        owners_(IndexPartition::make_even(comm_, nodes_)),
        order_(comm_, list_own_springs(), 2, owners_) {
    const Ints part = order_.find_ranks(comm_, list_own_springs(), 2).rank;
    Ints ranks(nodes_, -1);  // a node goes to the highest rank that touches it
    const Ints springs = comm_.all_gather(list_own_springs());
    const Ints parts = comm_.all_gather(part);
    for (std::size_t k = 0; k < springs.size(); ++k) {
      std::int32_t& rank = ranks[springs[k]];
      rank = std::max(rank, parts[k / 2]);
    }
    Ints nodes(ranks.size());
    std::iota(nodes.begin(), nodes.end(), 0);
    std::stable_sort(nodes.begin(), nodes.end(), [&](std::int32_t a, std::int32_t b) { return ranks[a] < ranks[b]; });
    Eigen::PermutationMatrix<Eigen::Dynamic> permutation(3 * nodes_);
    Ints row(ranks.size());
    std::vector<int> counts(comm_.size(), 0);
    for (std::int32_t k = 0; k < nodes_; ++k) {
      const std::int32_t node = nodes[k];
      row[node] = k;
      ++counts[ranks[node]];
      for (int d = 0; d < 3; ++d) permutation.indices()[3 * node + d] = 3 * k + d;
    }
    pencil_.dense_k = permutation * pencil_.dense_k * permutation.transpose();
    pencil_.dense_m = permutation * pencil_.dense_m * permutation.transpose();
    test::distribute(pencil_, counts);
    order_.renumber(comm_, Ints(row.begin() + owners_.own_begin(), row.begin() + owners_.own_begin() + owners_.own_count()));
  }

  const Pencil& pencil() const { return pencil_; }
  const MeshOrder& order() const { return order_; }
  const Communicator& comm() const { return comm_; }

 private:
  Ints list_own_springs() const {
    Ints springs;
    int next = 0;
    for (std::int32_t u = 0; u < nodes_; ++u)
      for (std::int32_t v = 0; v < u; ++v)
        if (!pencil_.dense_k.block<3, 3>(3 * u, 3 * v).isZero(0) && next++ % comm_.size() == comm_.rank())
          springs.insert(springs.end(), {u, v});
    return springs;
  }

  Communicator comm_;
  Pencil pencil_;
  std::int32_t nodes_;
  IndexPartition owners_;
  MeshOrder order_;
};

TEST(MeshOrder, only_rows_of_shared_fronts_are_sent) {
  const OrderedLattice lattice(12, 9, 4, 1);
  const Plan plan = make_plan(lattice.pencil().k, lattice.pencil().m, &lattice.order());
  std::int64_t travel = 0;
  for (const GivenRows& given : plan.given) travel += given.count;
  EXPECT_LE(lattice.comm().sum(travel), plan.analysis.shared_nodes);
  std::int64_t blocks = 0;
  for (const ReceivedBlocks& received : plan.received) blocks += static_cast<std::int64_t>(received.columns.size());
  EXPECT_EQ(lattice.comm().sum(blocks), 0) << "columns of own fronts were received";
}

TEST(MeshOrder, panels_and_columns_fill_the_planned_memory) {
  const OrderedLattice lattice(12, 9, 7, 1);
  const Plan plan = make_plan(lattice.pencil().k, lattice.pencil().m, &lattice.order());
  const Numbers numbers = make_numbers(plan);
  std::int64_t at = 0;
  for (std::size_t s = 0; s < plan.fronts.size(); ++s) {
    EXPECT_EQ(numbers.front_offsets[s], at);
    at += count_stored(plan.fronts[s].width, plan.fronts[s].size());
  }
  for (std::size_t f = 0; f < plan.shared.size(); ++f) {
    const SharedFront& front = plan.shared[f];
    std::int64_t column = numbers.shared_columns[f];
    EXPECT_EQ(column, at + kColumnsBegin);
    for (int k = 0; k < front.map.pivot_tiles(); ++k) {
      const SharedPanel& panel = numbers.shared[f][k];
      EXPECT_EQ(panel.tiles >= 0, front.map.has_column(front.place, k));
      if (panel.tiles < 0) continue;
      const std::int64_t n = 3 * std::int64_t{front.map.nodes(k)};
      if (panel.triangle >= 0) {
        EXPECT_EQ(panel.triangle, at);
        EXPECT_LE(at += count_triangle(n), column) << "written before its columns have been read";
      }
      EXPECT_EQ(panel.tiles, at);
      at += 3 * n * (front.own_nodes() - front.row_begin[k + 1]);
      column += 3 * n * (front.own_nodes() - front.row_begin[k]);
      EXPECT_LE(at, column) << "panel " << k << " overlaps the columns of the next panel";
    }
    at = column;
  }
  EXPECT_EQ(at, plan.room.panels);
  EXPECT_LE(at, numbers.panels.size());
  EXPECT_EQ(lattice.comm().sum(static_cast<std::int64_t>(plan.shared.size())) > 0, lattice.comm().size() > 1);
}

TEST(MeshOrder, solves_and_counts_as_dense_matrices_do) {
  for (const auto& [n, copies] : {std::pair(5, 1), std::pair(3, 4)}) {
    const OrderedLattice lattice(n + 2, n, n - 1, copies);
    const Pencil& pencil = lattice.pencil();
    Factor factor({pencil.k, pencil.m}, &lattice.order());
    const Eigen::VectorXd lambda =
        Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(pencil.dense_k, pencil.dense_m, Eigen::EigenvaluesOnly).eigenvalues();
    const double sigma = 0.5 * (lambda[lambda.size() / 3] + lambda[lambda.size() / 3 + 1]);
    ASSERT_TRUE(factor.factorise(sigma));
    EXPECT_EQ(factor.get_negative_pivots(), (lambda.array() < sigma).count());
    const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(pencil.dense_k.rows(), -1, 2);
    std::vector<double> x(b.data() + pencil.first_row, b.data() + pencil.first_row + pencil.rows);
    factor.solve(x.data(), x.data(), std::max<int>(pencil.rows, 1), 1);
    const Eigen::VectorXd expected = (pencil.dense_k - sigma * pencil.dense_m).partialPivLu().solve(b);
    for (PetscInt i = 0; i < pencil.rows; ++i) EXPECT_NEAR(x[i], expected[pencil.first_row + i], 1e-9 * expected.cwiseAbs().maxCoeff());
  }
}

TEST(MeshOrder, of_another_mesh_is_refused) {
  const OrderedLattice lattice(4, 4, 3, 1);
  const auto refuse = [&](const Pencil& other) -> std::string {
    try {
      const Factor factor({other.k, other.m}, &lattice.order());
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  Pencil larger = test::make_lattice(4, 4, 4, 1, test::MassKind::kDiagonal, 5);
  test::distribute(larger);
  EXPECT_NE(refuse(larger).find("different numbers of nodes"), std::string::npos);
  Pencil other = test::make_random(48, 20, 3);
  test::distribute(other);
  EXPECT_NE(refuse(other).find("lacks links"), std::string::npos);
}

}  // namespace
}  // namespace carillon::ldlt

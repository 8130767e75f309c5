// Parts of block Lanczos against dense matrices known on every rank.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "precompute/eigen/block_lanczos.hpp"
#include "precompute/eigen/inner_product.hpp"
#include "precompute/eigen/lanczos_basis.hpp"
#include "precompute/eigen/locked_modes.hpp"
#include "precompute/eigen/ritz.hpp"
#include "precompute/eigen/shift_invert.hpp"
#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/la/node_matrix.hpp"
#include "precompute/petsc/noise.hpp"
#include "tests/unit/precompute/eigen/spring_network.hpp"

namespace carillon::eigen {
namespace {

using la::Matrix;

MPI_Comm world() { return PETSC_COMM_WORLD; }

Matrix sum_over_ranks(Matrix matrix) {
  MPI_Allreduce(MPI_IN_PLACE, matrix.data(), static_cast<int>(matrix.size()), MPI_DOUBLE, MPI_SUM, world());
  return matrix;
}

Matrix gather(Mat sparse) {
  PetscInt n = 0, first = 0, last = 0;
  check(MatGetSize(sparse, &n, nullptr));
  check(MatGetOwnershipRange(sparse, &first, &last));
  Matrix dense = Matrix::Zero(n, n);
  for (PetscInt row = first; row < last; ++row) {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    check(MatGetRow(sparse, row, &count, &columns, &values));
    for (PetscInt k = 0; k < count; ++k) dense(row, columns[k]) = values[k];
    check(MatRestoreRow(sparse, row, &count, &columns, &values));
  }
  return sum_over_ranks(dense);
}

double find_largest(const Matrix& a) { return a.size() == 0 ? 0 : a.cwiseAbs().maxCoeff(); }

// A small free body, dense and distributed, its shift-invert operator, and memory for a basis.
class Rig {
 public:
  static constexpr int kBlock = 4;

  explicit Rig(int room) : system(test::make_system(make_block(2, 3, 4))), mass(system.mass), room_(room) {
    k = gather(system.stiffness);
    m = gather(system.mass);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix> dense(k, m);
    lambda = dense.eigenvalues();
    vectors = dense.eigenvectors();
    sigma = 0.5 * (lambda[20] + lambda[21]);
    inverse = (k - sigma * m).partialPivLu().inverse();
    check(MatGetOwnershipRange(system.stiffness, &first, &last));
    rows = last - first;
    factor_ = make_ldlt_factor({system.stiffness, system.mass});
    EXPECT_TRUE(factor_->factorise(sigma));
    memory_.assign(rows * (room + kBlock), 0.0);
    fill_at_random(view().part(0, kBlock));
  }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  Columns view() { return {memory_.data(), rows, rows, room_ + kBlock}; }
  void fill_at_random(const Columns& columns) const {
    for (int j = 0; j < columns.count; ++j)
      for (PetscInt i = 0; i < rows; ++i)
        columns.column(j)[i] = petsc::make_noise(static_cast<std::uint64_t>(first + i), static_cast<std::uint64_t>(j) + 1);
  }
  /// All rows of some columns, on every rank.
  Matrix gather_columns(const Columns& columns) const {
    Matrix all = Matrix::Zero(k.rows(), columns.count);
    for (int j = 0; j < columns.count; ++j) std::copy_n(columns.column(j), rows, all.col(j).data() + first);
    return sum_over_ranks(all);
  }
  /// Copies this rank's rows of column j of a dense matrix into a column.
  void scatter(const Matrix& all, Eigen::Index j, double* column) const { std::copy_n(all.col(j).data() + first, rows, column); }
  RitzGoal make_goal(double low, double high, int wanted) const {
    RitzGoal goal;
    goal.low = low;
    goal.high = high;
    goal.wanted = wanted;
    goal.sigma = sigma;
    goal.tolerance = 1e-10;
    return goal;
  }

  ShiftInvert make_inverse() const { return {*factor_, sigma}; }

  test::System system;
  la::NodeMatrix mass;
  Matrix k, m, vectors, inverse;
  la::Vector lambda;
  double sigma = 0;
  PetscInt first = 0, last = 0, rows = 0;

 private:
  int room_;
  std::unique_ptr<ShiftedFactor> factor_;
  std::vector<double> memory_;
};

TEST(ShiftInvert, is_the_dense_inverse) {
  Rig rig(2 * Rig::kBlock);
  const Columns b = rig.view().part(0, Rig::kBlock), x = rig.view().part(Rig::kBlock, Rig::kBlock);
  const Matrix expected = rig.inverse * rig.gather_columns(b);
  ShiftInvert inverse = rig.make_inverse();
  EXPECT_EQ(inverse.get_sigma(), rig.sigma);
  inverse.apply(b, x);
  EXPECT_LT(find_largest(rig.gather_columns(x) - expected), 1e-10 * find_largest(expected));
  inverse.apply(b, b);
  EXPECT_LT(find_largest(rig.gather_columns(b) - expected), 1e-10 * find_largest(expected));
  EXPECT_EQ(inverse.get_solves(), 2 * Rig::kBlock);
}

TEST(InnerProduct, multiplies_by_the_mass_at_every_place_of_its_block) {
  Rig rig(2 * Rig::kBlock);
  rig.fill_at_random(rig.view());
  InnerProduct inner(world(), rig.mass, rig.rows, Rig::kBlock);
  for (const int at : {0, 3, Rig::kBlock}) {
    inner.place(rig.view().part(at, Rig::kBlock));
    inner.multiply();
    const Matrix v = rig.gather_columns(rig.view());
    const Matrix z = rig.m * v.middleCols(at, Rig::kBlock);
    EXPECT_LT(find_largest(rig.gather_columns(inner.z()) - z), 1e-14);
    const Matrix products = v.transpose() * z;
    EXPECT_LT(find_largest(inner.calc_products(rig.view(), inner.z()) - products), 1e-13);
  }
}

// With a full and a diagonal mass matrix, against products of Eigen. The mass of the rig is diagonal, so its stiffness serves as the full
// one.
TEST(InnerProduct, subtracts_multiplies_and_combines_in_one_pass) {
  Rig rig(2 * Rig::kBlock);
  for (const bool is_diagonal : {false, true}) {
    rig.fill_at_random(rig.view());
    petsc::MatHandle mass;
    check(MatDuplicate(is_diagonal ? rig.system.mass : rig.system.stiffness, MAT_COPY_VALUES, mass.out()));
    const double scale = 1.0 / find_largest(is_diagonal ? rig.m : rig.k);
    check(MatScale(mass, scale));
    Matrix m = scale * (is_diagonal ? rig.m : rig.k);
    if (is_diagonal) {
      petsc::VecHandle diagonal;
      check(MatCreateVecs(mass, nullptr, diagonal.out()));
      check(MatGetDiagonal(mass, diagonal));
      check(MatZeroEntries(mass));
      check(MatDiagonalSet(mass, diagonal, INSERT_VALUES));
      m = Matrix(m.diagonal().asDiagonal());
    }
    const la::NodeMatrix blocks(mass);
    ASSERT_EQ(blocks.is_diagonal(), is_diagonal);
    InnerProduct inner(world(), blocks, rig.rows, Rig::kBlock);
    inner.place(rig.view().part(Rig::kBlock, Rig::kBlock));
    const Columns a = rig.view().part(0, Rig::kBlock);
    const Matrix v = rig.gather_columns(a), old = rig.gather_columns(inner.w());
    Matrix s(Rig::kBlock + 1, Rig::kBlock), t(Rig::kBlock, Rig::kBlock);
    for (Eigen::Index i = 0; i < s.size(); ++i) s.data()[i] = std::sin(1.1 * static_cast<double>(i));
    for (Eigen::Index i = 0; i < t.size(); ++i) t.data()[i] = std::cos(0.7 * static_cast<double>(i));
    std::array<double, 2> sums{1, 0.5};
    const std::vector<Columns> sets{rig.view().part(0, 2 * Rig::kBlock), a.part(1, 2)};
    const Matrix products = inner.subtract_and_calc_products({a, s.data()}, Rig::kBlock + 1, sets, Rig::kBlock, sums);
    const Matrix w = old - v * s.topRows(Rig::kBlock);
    EXPECT_LT(find_largest(rig.gather_columns(inner.w()) - w), 1e-13);
    Matrix expected(2 * Rig::kBlock + 2, Rig::kBlock);
    expected << v.transpose() * m * w, w.transpose() * m * w, v.middleCols(1, 2).transpose() * m * w;
    EXPECT_LT(find_largest(products - expected), 1e-12);
    int ranks = 1;
    MPI_Comm_size(world(), &ranks);
    EXPECT_EQ(sums[0], ranks);
    EXPECT_EQ(sums[1], 0.5 * ranks);
    const std::vector<la::Product> subtracted{{a, s.data()}};
    inner.subtract_and_combine(subtracted, Rig::kBlock + 1, t.data(), Rig::kBlock);
    const Matrix combined = (w - v * s.topRows(Rig::kBlock)) * t;
    EXPECT_LT(find_largest(rig.gather_columns(inner.w()) - combined), 1e-12);
    EXPECT_LT(find_largest(rig.gather_columns(inner.z()) - m * combined), 1e-12);
  }
}

TEST(LockedModes, are_projected_out_by_range) {
  Rig rig(Rig::kBlock);
  std::vector<double> values(7 * rig.rows);
  LockedModes locked;
  for (int j = 0; j < 7; ++j) {
    rig.scatter(rig.vectors, j, values.data() + j * rig.rows);
    locked.lambda.push_back(rig.lambda[j]);
  }
  locked.sets = {{values.data(), rig.rows, rig.rows, 3}, {values.data() + 3 * rig.rows, rig.rows, rig.rows, 4}};
  InnerProduct inner(world(), rig.mass, rig.rows, Rig::kBlock);
  inner.place(rig.view());
  inner.multiply();
  const Matrix w = rig.gather_columns(inner.w());
  const Matrix parts = locked.project_out(world(), {2, 4}, inner.w(), inner.z());  // of both sets
  const Matrix l = rig.vectors.middleCols(2, 4);
  EXPECT_LT(find_largest(parts - l.transpose() * rig.m * w), 1e-13);
  EXPECT_LT(find_largest(rig.gather_columns(inner.w()) - (w - l * parts)), 1e-13);
}

// A^-1 M V = V T + V_next R E^T, and V and V_next M-orthonormal.
void expect_krylov_relation(const Rig& rig, const LanczosBasis& basis, const char* when) {
  const int n = basis.size(), next = basis.next_width();
  const Matrix v = rig.gather_columns(basis.columns(0, n));
  const Matrix both = rig.gather_columns(basis.columns(0, n + next));
  Matrix relation = rig.inverse * rig.m * v - v * basis.t().topLeftCorner(n, n);
  relation.rightCols(basis.width()) -= both.rightCols(next) * basis.coupling();
  const double scale = 1 / (rig.lambda.array() - rig.sigma).abs().minCoeff();
  EXPECT_LT(find_largest(relation), 1e-8 * scale) << when;
  EXPECT_LT(find_largest(both.transpose() * rig.m * both - Matrix::Identity(n + next, n + next)), 1e-9) << when;
  EXPECT_LT(find_largest(basis.t() - basis.t().transpose()), 1e-12 * scale) << when;
}

TEST(LanczosBasis, keeps_the_krylov_relation_through_steps_and_restarts) {
  constexpr int kRoom = 32;
  Rig rig(kRoom);
  ShiftInvert inverse = rig.make_inverse();
  const auto n = static_cast<PetscInt>(rig.k.rows());
  InnerProduct inner(world(), rig.mass, rig.rows, Rig::kBlock);
  LanczosBasis basis(rig.view(), kRoom, Rig::kBlock);
  const LockedModes none;
  BlockLanczos lanczos({inverse, inner, basis, none, n, rig.first}, rig.make_goal(rig.lambda[15], rig.lambda[25], 11), 100, nullptr);
  ASSERT_TRUE(lanczos.start());
  int restarts = 0;
  for (int step = 0; step < 16; ++step) {
    ASSERT_TRUE(lanczos.step());
    expect_krylov_relation(rig, basis, "after a step");
    if (basis.is_full()) {
      RitzPairs pairs = calc_ritz_pairs(world(), basis);
      lanczos.restart(pairs, select(pairs, rig.make_goal(rig.lambda[15], rig.lambda[25], 11)));
      expect_krylov_relation(rig, basis, "after a restart");
      ++restarts;
    }
    basis.append();
  }
  EXPECT_GE(restarts, 2);
}

TEST(RitzStep, agrees_with_a_dense_solver_and_has_true_residuals) {
  Rig rig(72 + Rig::kBlock);
  ShiftInvert inverse = rig.make_inverse();
  const auto n = static_cast<PetscInt>(rig.k.rows());
  InnerProduct inner(world(), rig.mass, rig.rows, Rig::kBlock);
  LanczosBasis basis(rig.view(), n, Rig::kBlock);
  const LockedModes none;
  BlockLanczos lanczos({inverse, inner, basis, none, n, rig.first}, rig.make_goal(0, 1, 1), 100, nullptr);
  ASSERT_TRUE(lanczos.start());
  for (int step = 0; lanczos.step(); ++step) {
    if (step == 5) {
      RitzPairs pairs = calc_ritz_pairs(world(), basis);
      share_vectors(world(), pairs);
      const Matrix x = rig.gather_columns(basis.columns(0, basis.size())) * pairs.vectors;
      const Matrix r = rig.inverse * rig.m * x - x * pairs.theta.asDiagonal();
      const double scale = pairs.theta.cwiseAbs().maxCoeff();
      for (int j = 0; j < basis.size(); ++j) EXPECT_NEAR(pairs.residual[j], std::sqrt(r.col(j).dot(rig.m * r.col(j))), 1e-10 * scale) << j;
    }
    basis.append();
  }
  ASSERT_EQ(basis.size(), n) << "the whole space";
  const RitzPairs pairs = calc_ritz_pairs(world(), basis);
  std::vector<double> expected;
  for (const double x : rig.lambda) expected.push_back(1 / (x - rig.sigma));
  std::sort(expected.begin(), expected.end());
  const double scale = std::max(std::abs(expected.front()), std::abs(expected.back()));
  for (PetscInt j = 0; j < n; ++j) EXPECT_NEAR(pairs.theta[j], expected[j], 1e-12 * scale) << j;
}

TEST(RitzStep, selects_an_interval_and_detects_completion) {
  RitzGoal goal;
  goal.low = 2;
  goal.high = 4;
  goal.wanted = 3;
  goal.sigma = 3.1;
  goal.tolerance = 1e-8;
  const std::vector<double> lambda{3.0, 2.2, 1.0, 9.0, 5.2, 3.6};  // by ascending theta
  RitzPairs pairs;
  pairs.theta.resize(6);
  for (int i = 0; i < 6; ++i) pairs.theta[i] = 1 / (lambda[i] - goal.sigma);
  pairs.residual = {1e-15, 1e-15, 1e-15, 1e-15, 1e-15, 1e-3};
  RitzSelection selection = select(pairs, goal);
  EXPECT_EQ(selection.converged, 2);
  EXPECT_EQ(selection.order, (std::vector<int>{0, 1, 5, 2, 4, 3})) << "converged, inside, then by nearness";
  EXPECT_FALSE(selection.is_complete) << "3.6 is in the interval and has not converged";
  pairs.residual[5] = 1e-15;
  EXPECT_TRUE(select(pairs, goal).is_complete);
  goal.wanted = 7;
  EXPECT_TRUE(select(pairs, goal).is_complete) << "1.0 and 5.2 are outside the interval and have converged";
  pairs.residual = {1e-15, 1e-15, 1, 1, 1, 1e-15};
  EXPECT_FALSE(select(pairs, goal).is_complete);
}

TEST(Orthogonaliser, replaces_dependent_columns_of_the_starting_block) {
  Rig rig(20);
  std::copy_n(rig.view().column(0), rig.rows, rig.view().column(2));
  std::fill_n(rig.view().column(3), rig.rows, 0.0);
  ShiftInvert inverse = rig.make_inverse();
  const auto n = static_cast<PetscInt>(rig.k.rows());
  InnerProduct inner(world(), rig.mass, rig.rows, Rig::kBlock);
  LanczosBasis basis(rig.view(), 20, Rig::kBlock);
  const LockedModes none;
  BlockLanczos lanczos({inverse, inner, basis, none, n, rig.first}, rig.make_goal(0, 1, 1), 100, nullptr);
  ASSERT_TRUE(lanczos.start());
  ASSERT_EQ(basis.width(), Rig::kBlock);
  const Matrix v = rig.gather_columns(basis.columns(0, Rig::kBlock));
  EXPECT_LT(find_largest(v.transpose() * rig.m * v - Matrix::Identity(Rig::kBlock, Rig::kBlock)), 1e-12);
}

// Hard cases for the Gram matrix computed with the products: nearly dependent columns, where it is insufficient; and locked modes that make
// up nearly all of a column, where w^T M w - c^T c cancels. Bound: orthonormal to 1e-12.
TEST(Orthogonaliser, keeps_nearly_dependent_and_nearly_locked_columns_orthonormal) {
  for (const double rest : {1e-1, 1e-3, 1e-6, 1e-9}) {
    Rig rig(20);
    std::vector<double> known(2 * rig.rows);
    LockedModes locked;
    for (int j = 0; j < 2; ++j) {
      rig.scatter(rig.vectors, j, known.data() + j * rig.rows);
      locked.lambda.push_back(rig.lambda[j]);
    }
    locked.sets = {{known.data(), rig.rows, rig.rows, 2}};
    for (PetscInt i = 0; i < rig.rows; ++i) {
      rig.view().column(1)[i] = rig.view().column(0)[i] + rest * rig.view().column(1)[i];
      rig.view().column(2)[i] = known[i] + rest * rig.view().column(2)[i];
    }
    ShiftInvert inverse = rig.make_inverse();
    const auto n = static_cast<PetscInt>(rig.k.rows());
    InnerProduct inner(world(), rig.mass, rig.rows, Rig::kBlock);
    LanczosBasis basis(rig.view(), 20, Rig::kBlock);
    BlockLanczos lanczos({inverse, inner, basis, locked, n, rig.first}, rig.make_goal(0, 1, 1), 100, nullptr);
    ASSERT_TRUE(lanczos.start());
    ASSERT_TRUE(lanczos.step());
    const Matrix v = rig.gather_columns(basis.columns(0, 2 * Rig::kBlock));
    EXPECT_LT(find_largest(v.transpose() * rig.m * v - Matrix::Identity(2 * Rig::kBlock, 2 * Rig::kBlock)), 1e-12) << rest;
    EXPECT_LT(find_largest(rig.vectors.leftCols(2).transpose() * rig.m * v), 1e-12) << rest;
  }
}

}  // namespace
}  // namespace carillon::eigen

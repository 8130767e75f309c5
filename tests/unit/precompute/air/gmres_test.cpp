// GMRES with many right-hand sides against dense factorisation.
#include "precompute/air/gmres.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <random>
#include <vector>

#include "precompute/air/equations.hpp"

namespace carillon::air {
namespace {

using Matrix = Eigen::MatrixXcd;

Matrix make_random(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> value;
  Matrix matrix(rows, columns);
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j < columns; ++j) matrix(i, j) = {value(random), value(random)};
  return matrix;
}

Sides pack(const Matrix& matrix) {
  std::vector<std::complex<float>> rows;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) rows.emplace_back(matrix(i, j));
  return Sides(rows, static_cast<std::size_t>(matrix.rows()), static_cast<std::size_t>(matrix.cols()));
}

Matrix unpack(const Sides& sides) {
  const std::vector<std::complex<float>> rows = sides.list();
  Matrix matrix(static_cast<Eigen::Index>(sides.unknowns), static_cast<Eigen::Index>(sides.count));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) matrix(i, j) = rows[i * matrix.cols() + j];
  return matrix;
}

Multiply make_multiply(const Matrix& matrix, int* products = nullptr) {
  return [&matrix, products](const Sides& x, Sides& y) {
    if (products) ++*products;
    y = pack(matrix * unpack(x));
  };
}

/// Identity plus a matrix whose spectrum fills a disc of this radius.
Matrix make_system(Eigen::Index size, double radius, unsigned seed) {
  return Matrix::Identity(size, size) + radius / std::sqrt(2.0 * static_cast<double>(size)) * make_random(size, size, seed);
}

/// Largest error of a side relative to its solution.
double find_worst(const Matrix& found, const Matrix& wanted) {
  double worst = 0.0;
  for (Eigen::Index j = 0; j < wanted.cols(); ++j) worst = std::max(worst, (found.col(j) - wanted.col(j)).norm() / wanted.col(j).norm());
  return worst;
}

TEST(gmres, solves_random_systems_as_dense_factors_do) {
  for (const Eigen::Index size : {1, 2, 7, 40, 150})
    for (const Eigen::Index sides : {1, 3, 17}) {
      const Matrix matrix = make_system(size, 0.5, static_cast<unsigned>(size)), right = make_random(size, sides, 99);
      const Matrix wanted = matrix.partialPivLu().solve(right);
      Sides solution(static_cast<std::size_t>(size), static_cast<std::size_t>(sides));
      int products = 0;
      const GmresResult result = solve_gmres(make_multiply(matrix, &products), pack(right), {.tolerance = 1e-5}, solution);
      EXPECT_TRUE(result.is_converged) << size;
      EXPECT_EQ(result.products, products);
      EXPECT_LE(result.residual, 1e-5);
      const Matrix found = unpack(solution);
      for (Eigen::Index j = 0; j < sides; ++j) {
        const double residual = (right.col(j) - matrix * found.col(j)).norm() / right.col(j).norm();
        EXPECT_LE(residual, 1.2e-5);  // of every side, not only the largest
      }
      // |x - x'| <= |A^-1| |r|
      const double condition = matrix.jacobiSvd().singularValues()(0) / matrix.jacobiSvd().singularValues()(size - 1);
      EXPECT_LT(find_worst(found, wanted), 1.2e-5 * condition) << size;
    }
}

TEST(gmres, solves_sides_of_different_difficulty_each_to_the_tolerance) {
  // A diagonal matrix: a right-hand side with few eigenvectors converges after few products and must stay converged.
  const Eigen::Index size = 60;
  Matrix matrix = Matrix::Zero(size, size), right = Matrix::Zero(size, 4);
  for (Eigen::Index i = 0; i < size; ++i) matrix(i, i) = std::complex<double>(1.0 + 0.05 * static_cast<double>(i), 0.3);
  right(3, 0) = {2.0, -1.0};                     // one eigenvector: one product
  right(10, 1) = 1e-6;                           // two of them, tiny
  right(50, 1) = {0.0, 2e-6};                    //
  right.col(2) = 1e6 * make_random(size, 1, 5);  // all, large
  right.col(3) = make_random(size, 1, 6);        // all
  Sides solution(static_cast<std::size_t>(size), 4);
  const GmresResult result = solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-5}, solution);
  ASSERT_TRUE(result.is_converged);
  EXPECT_LT(find_worst(unpack(solution), matrix.partialPivLu().solve(right)), 5e-5);
}

TEST(gmres, leaves_a_zero_right_side_zero) {
  const Matrix matrix = make_system(30, 0.5, 1);
  Matrix right = make_random(30, 3, 2);
  right.col(1).setZero();
  Sides solution(30, 3);
  const GmresResult result = solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-5}, solution);
  EXPECT_TRUE(result.is_converged);
  const Matrix found = unpack(solution), wanted = matrix.partialPivLu().solve(right);
  EXPECT_EQ(found.col(1).norm(), 0.0);
  EXPECT_LT((found.col(2) - wanted.col(2)).norm(), 1e-4 * wanted.col(2).norm());
  Sides nothing(30, 2);
  const GmresResult none = solve_gmres(make_multiply(matrix), Sides(30, 2), {}, nothing);
  EXPECT_TRUE(none.is_converged);
  EXPECT_EQ(none.products, 0);
  Sides no_sides(30, 0);
  EXPECT_TRUE(solve_gmres(make_multiply(matrix), Sides(30, 0), {}, no_sides).is_converged);
}

TEST(gmres, converges_over_restarts) {
  const Matrix matrix = make_system(80, 0.6, 3), right = make_random(80, 2, 4);
  Sides whole(80, 2), pieces(80, 2);
  const GmresResult one = solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-5}, whole);
  const GmresResult many = solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-5, .max_products = 300, .restart = 4}, pieces);
  ASSERT_TRUE(one.is_converged && many.is_converged);
  EXPECT_GT(many.products, one.products);
  EXPECT_GT(one.products, 5);
  EXPECT_LT(find_worst(unpack(pieces), matrix.partialPivLu().solve(right)), 1e-4);
}

TEST(gmres, begins_with_a_guess) {
  const Matrix matrix = make_system(80, 0.6, 5), right = make_random(80, 2, 6), wanted = matrix.partialPivLu().solve(right);
  Sides solved = pack(wanted), near = pack(wanted + 1e-3 * make_random(80, 2, 7)), cold(80, 2);
  const GmresResult done = solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-5}, solved);
  EXPECT_TRUE(done.is_converged);
  EXPECT_EQ(done.products, 1);
  const GmresResult warm = solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-5}, near);
  const GmresResult full = solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-5}, cold);
  EXPECT_TRUE(warm.is_converged);
  EXPECT_LT(warm.products, full.products);
  EXPECT_LT(find_worst(unpack(near), wanted), 1e-4);
}

TEST(gmres, ends_without_convergence_where_there_is_no_solution) {
  // Singular, with a right-hand side outside the range.
  Matrix matrix = make_system(40, 0.5, 8);
  matrix.row(39) = matrix.row(38);
  const Matrix right = make_random(40, 2, 9);
  Sides solution(40, 2);
  const GmresResult result =
      solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-5, .max_products = 150, .restart = 30}, solution);
  EXPECT_FALSE(result.is_converged);
  EXPECT_GT(result.residual, 1e-3);
  EXPECT_LE(result.products, 152);
  // The zero matrix.
  const Matrix zero = Matrix::Zero(40, 40);
  Sides other(40, 2);
  EXPECT_FALSE(solve_gmres(make_multiply(zero), pack(right), {.tolerance = 1e-5, .max_products = 20}, other).is_converged);
}

TEST(gmres, solves_a_singular_system_that_has_solutions) {
  Matrix matrix = make_system(40, 0.4, 10);
  matrix.row(39) = matrix.row(38);
  const Matrix right = matrix * make_random(40, 2, 11);
  Sides solution(40, 2);
  const GmresResult result = solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-4}, solution);
  const Matrix found = unpack(solution);
  ASSERT_TRUE(result.is_converged);
  ASSERT_TRUE(found.allFinite());
  EXPECT_LT((right - matrix * found).norm(), 2e-4 * right.norm());
}

TEST(gmres, never_calls_a_result_that_is_not_finite_converged) {
  const Matrix matrix = make_system(20, 0.5, 12);
  Matrix right = make_random(20, 2, 13);
  right(4, 1) = std::nan("");
  Sides solution(20, 2);
  EXPECT_FALSE(solve_gmres(make_multiply(matrix), pack(right), {.tolerance = 1e-5, .max_products = 20}, solution).is_converged);
  Matrix bad = matrix;
  bad(3, 3) = std::nan("");
  Sides other(20, 2);
  EXPECT_FALSE(solve_gmres(make_multiply(bad), pack(make_random(20, 2, 14)), {.tolerance = 1e-5, .max_products = 20}, other).is_converged);
}

TEST(gmres, gives_the_same_bits_each_time) {
  const Matrix matrix = make_system(50, 0.6, 15), right = make_random(50, 5, 16);
  Sides one(50, 5), two(50, 5);
  solve_gmres(make_multiply(matrix), pack(right), {}, one);
  solve_gmres(make_multiply(matrix), pack(right), {}, two);
  EXPECT_EQ(one.values, two.values);
}

TEST(solve_directly, is_the_dense_solution_to_single_precision) {
  constexpr std::size_t kUnknowns = 60, kSides = 3;
  std::mt19937 random(7);
  std::normal_distribution<double> number;
  Eigen::MatrixXcd matrix(kUnknowns, kUnknowns), right(kUnknowns, kSides);
  for (auto* block : {&matrix, &right})
    for (Eigen::Index i = 0; i < block->size(); ++i) block->data()[i] = {number(random), number(random)};
  matrix += 5.0 * Eigen::MatrixXcd::Identity(kUnknowns, kUnknowns);
  LinearSystem system;
  system.unknowns = system.last = kUnknowns;
  system.sides = kSides;
  for (std::size_t i = 0; i < kUnknowns; ++i) {
    for (std::size_t j = 0; j < kUnknowns; ++j)
      system.matrix.emplace_back(matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
    for (std::size_t m = 0; m < kSides; ++m) system.right.emplace_back(right(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(m)));
  }
  Sides solution;
  EXPECT_LT(solve_directly(system, solution), 1e-5);
  const Eigen::MatrixXcd exact = matrix.partialPivLu().solve(right);
  for (std::size_t i = 0; i < kUnknowns; ++i)
    for (std::size_t m = 0; m < kSides; ++m) {
      const auto wanted = exact(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(m));
      EXPECT_NEAR(solution.get_real(i)[m], wanted.real(), 1e-5 * exact.norm());
      EXPECT_NEAR(solution.get_imaginary(i)[m], wanted.imag(), 1e-5 * exact.norm());
    }
}

}  // namespace
}  // namespace carillon::air

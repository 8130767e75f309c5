// Method: ||R_j s_i||, with the last block row of eigenvector s_i of T, is the residual of the Ritz pair. A vector has converged if its
// angle, the residual over the distance to the next Ritz value, is small as well (Parlett, section 11.7).
// Source: Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994, section 3; Parlett, The
// symmetric eigenvalue problem, 1998.
#include "precompute/eigen/ritz.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

constexpr double kVectorAngle = 1e-7;     // Required angle between a Ritz vector and its eigenvector,
constexpr double kThetaRounding = 1e-14;  // as far as residuals resolve it, relative to theta.
constexpr double kRitzMerge = 1e-9;       // Ritz values closer than this (relative) are treated as equal.
constexpr double kSettled = 1e-3;         // A Ritz value with a smaller error is not spurious.
constexpr double kEigenFlops = 9;         // of n^3: a symmetric eigenproblem with its vectors (Golub, Van Loan, 8.3)

// Distance from theta_i to the nearest distinct Ritz value.
double calc_gap(const la::Vector& theta, Eigen::Index i) {
  const double same = kRitzMerge * std::abs(theta[i]);
  double gap = std::numeric_limits<double>::infinity();
  for (Eigen::Index k = i; k > 0; --k) {
    gap = theta[i] - theta[k - 1];
    if (gap > same) break;
  }
  for (Eigen::Index k = i + 1; k < theta.size(); ++k) {
    if (theta[k] - theta[i] <= same) continue;
    return std::min(gap, theta[k] - theta[i]);
  }
  return gap;
}

void order_interval(RitzSelection& selection, const la::Vector& theta, const std::vector<double>& lambda, const RitzGoal& goal) {
  const auto at = [&](int i) { return lambda[i]; };
  const auto error = [&](int i) { return selection.error[i]; };
  const auto is_inside = [&](int i) { return at(i) >= goal.low && at(i) <= goal.high; };
  std::vector<int>& order = selection.order;
  // Order: converged pairs in the interval, other pairs in the interval, then pairs outside by distance from the shift.
  const auto rank = [&](int i) { return is_inside(i) ? (error(i) <= goal.tolerance ? 0 : 1) : 2; };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    if (rank(a) != rank(b)) return rank(a) < rank(b);
    return rank(a) == 2 && std::abs(theta[a]) > std::abs(theta[b]);
  });
  selection.converged = std::count_if(order.begin(), order.end(), [&](int i) { return rank(i) == 0; });
  const std::int64_t inside = std::count_if(order.begin(), order.end(), is_inside);
  // A converged Ritz value beyond the farther end shows that the iteration has covered the interval.
  const double reach = std::max(goal.high - goal.sigma, goal.sigma - goal.low);
  const bool sees_past = std::any_of(order.begin(), order.end(),
                                     [&](int i) { return !is_inside(i) && std::abs(at(i) - goal.sigma) > reach && error(i) <= kSettled; });
  selection.is_complete = (goal.is_count_known && selection.converged >= goal.wanted) || (inside == selection.converged && sees_past);
}

}  // namespace

double calc_ritz_error(double sigma, double theta, double residual) {
  constexpr double kMaxLoss = 1e3;
  const double lambda = std::abs(sigma + 1 / theta);
  const double loss = std::min(std::abs(1 / theta) / std::max(lambda, std::numeric_limits<double>::epsilon()), kMaxLoss);
  return residual / std::abs(theta) * std::max(loss, 1.0);
}

RitzPairs calc_ritz_pairs(const comm::Communicator& comm, const LanczosBasis& basis) {
  const int n = basis.size(), width = basis.width();
  const la::Matrix& r = basis.coupling();
  RitzPairs pairs;
  pairs.theta = la::Vector::Zero(n);
  la::Matrix last = la::Matrix::Zero(width, n);
  comm.agree([&] {  // One rank computes, all use its bits, so that decisions agree.
    if (!comm.is_root()) return;
    pairs.vectors = basis.t().topLeftCorner(n, n);
    if (la::calc_eigenpairs_by_division(pairs.vectors, pairs.theta) != 0)
      throw SolveError("The projected eigenproblem of block Lanczos did not converge (LAPACK dsyevd).");
    petsc::add_flops(kEigenFlops * static_cast<double>(n) * n * n);
    last = pairs.vectors.bottomRows(width);
  });
  comm.broadcast_into(la::entries(pairs.theta));
  comm.broadcast_into(la::entries(last));
  for (int i = 0; i < n; ++i) {
    double square = 0;
    for (int k = 0; k < r.rows(); ++k) {
      double sum = 0;
      for (int j = 0; j < width; ++j) sum += r(k, j) * last(j, i);
      square += sum * sum;
    }
    pairs.residual.push_back(std::sqrt(square));
  }
  return pairs;
}

void share_vectors(const comm::Communicator& comm, RitzPairs& pairs) {
  pairs.vectors.resize(pairs.theta.size(), pairs.theta.size());
  comm.broadcast_into(la::entries(pairs.vectors));
}

RitzSelection select(const RitzPairs& pairs, const RitzGoal& goal) {
  RitzSelection selection;
  std::vector<double> lambda;
  for (Eigen::Index i = 0; i < pairs.theta.size(); ++i) {
    const double theta = pairs.theta[i];
    const double residual = pairs.residual[i];
    const double error = calc_ritz_error(goal.sigma, theta, residual);
    const double allowed = std::max(kVectorAngle * calc_gap(pairs.theta, i), kThetaRounding * std::abs(theta));
    selection.error.push_back(std::max(error, residual / allowed * goal.tolerance));
    lambda.push_back(to_lambda(goal.sigma, theta));
  }
  selection.order.resize(lambda.size());
  std::iota(selection.order.begin(), selection.order.end(), 0);
  order_interval(selection, pairs.theta, lambda, goal);
  return selection;
}

la::Matrix pick_vectors(const RitzPairs& pairs, const RitzSelection& selection, int count) {
  la::Matrix picked(pairs.theta.size(), count);
  for (int j = 0; j < count; ++j) picked.col(j) = pairs.vectors.col(selection.order[j]);
  return picked;
}

}  // namespace carillon::eigen

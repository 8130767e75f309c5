// Method:     Active set: the entry with the steepest descent joins; the least-squares solution on the active entries replaces x, stopped
//   where an entry would become negative, which then leaves. Normal equations of the active columns.
// Source:     Lawson, Hanson, Solving Least Squares Problems, 1974, chapter 23.
// Deviations: early stopping, to keep few entries.
#include "precompute/coupling/nonnegative.hpp"

#include <Eigen/Dense>
#include <algorithm>

namespace carillon::coupling {

namespace {

/// A^T A and A^T b of the active columns.
struct Normal {
  std::vector<std::ptrdiff_t> joined;
  la::Matrix products;  // (capacity, capacity), the first joined.size() used
  la::Vector sides;

  std::ptrdiff_t size() const { return static_cast<std::ptrdiff_t>(joined.size()); }
  void add(const la::Matrix& a, const la::Vector& b, std::ptrdiff_t column) {
    const std::ptrdiff_t n = size();
    for (std::ptrdiff_t i = 0; i < n; ++i) products(i, n) = products(n, i) = a.col(joined[i]).dot(a.col(column));
    products(n, n) = a.col(column).squaredNorm();
    sides[n] = a.col(column).dot(b);
    joined.push_back(column);
  }
  void remove(std::ptrdiff_t at) {
    for (std::ptrdiff_t i = at; i + 1 < size(); ++i) {
      products.row(i).head(size()) = products.row(i + 1).head(size()).eval();
      sides[i] = sides[i + 1];
    }
    for (std::ptrdiff_t i = at; i + 1 < size(); ++i) products.col(i).head(size()) = products.col(i + 1).head(size()).eval();
    joined.erase(joined.begin() + at);
  }
  la::Vector solve() const { return products.topLeftCorner(size(), size()).ldlt().solve(sides.head(size())); }
};

/// Moves x towards the least-squares solution on the active columns; entries that would become negative leave one by one.
void settle(Normal& normal, la::Vector& x) {
  while (normal.size() > 0) {
    const la::Vector wanted = normal.solve();
    double step = 1;
    std::ptrdiff_t leaves = -1;
    for (std::ptrdiff_t i = 0; i < normal.size(); ++i) {
      const double from = x[normal.joined[i]];
      if (wanted[i] > 0 || (leaves >= 0 && from / (from - wanted[i]) >= step)) continue;
      step = from > 0 ? from / (from - wanted[i]) : 0.0;
      leaves = i;
    }
    for (std::ptrdiff_t i = 0; i < normal.size(); ++i) {
      double& value = x[normal.joined[i]];
      value += step * (wanted[i] - value);
    }
    if (leaves < 0) return;
    x[normal.joined[leaves]] = 0;
    normal.remove(leaves);
  }
}

}  // namespace

la::Vector solve_nonnegative(const la::Matrix& a, const la::Vector& b, double tolerance, std::ptrdiff_t most) {
  constexpr double kSlope = 1e-12;  // relative to |b|: stationary
  la::Vector x = la::Vector::Zero(a.cols());
  const la::Vector norms = a.colwise().norm().transpose();
  std::vector<char> barred(a.cols(), 0);  // entries that left immediately after joining
  Normal normal{{}, la::Matrix(most, most), la::Vector(most)};
  la::Vector residual = b;
  while (normal.size() < most && residual.norm() > tolerance * b.norm()) {
    const la::Vector slope = a.transpose() * residual;
    std::ptrdiff_t best = -1;
    double steepest = kSlope * b.norm();
    for (std::ptrdiff_t j = 0; j < a.cols(); ++j)
      if (x[j] == 0 && barred[j] == 0 && slope[j] > steepest * norms[j]) {
        steepest = slope[j] / norms[j];
        best = j;
      }
    if (best < 0) break;
    normal.add(a, b, best);
    settle(normal, x);
    if (x[best] > 0)
      std::fill(barred.begin(), barred.end(), char{0});
    else
      barred[best] = 1;
    residual = b - a * x;
  }
  return x;
}

}  // namespace carillon::coupling

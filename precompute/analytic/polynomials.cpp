#include "precompute/analytic/polynomials.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include "precompute/la/decompositions.hpp"

namespace carillon::analytic {

la::Vector calc_legendre(int n, double x, int order) {
  const double t = 2.0 * x - 1.0;
  std::array<la::Vector, 3> p;  // values, first and second derivative in t
  for (la::Vector& values : p) values = la::Vector::Zero(n);
  p[0](0) = 1.0;
  if (n > 1) p[0](1) = t, p[1](1) = 1.0;
  for (int k = 2; k < n; ++k) {
    p[0](k) = ((2 * k - 1) * t * p[0](k - 1) - (k - 1) * p[0](k - 2)) / k;
    p[1](k) = p[1](k - 2) + (2 * k - 1) * p[0](k - 1);
    p[2](k) = p[2](k - 2) + (2 * k - 1) * p[1](k - 1);
  }
  la::Vector& values = p[order];
  for (int k = 0; k < n; ++k) values(k) *= std::sqrt(2 * k + 1.0) * std::pow(2.0, order);
  return values;
}

namespace {

/// P_n and P_(n-1) at t.
std::array<double, 2> calc_legendre_pair(int n, double t) {
  double now = 1.0, before = 0.0;
  for (int k = 1; k <= n; ++k) {
    const double next = ((2 * k - 1) * t * now - (k - 1) * before) / k;
    before = now;
    now = next;
  }
  return {now, before};
}

}  // namespace

GaussRule make_gauss_rule(int n) {
  GaussRule rule;
  for (int i = 0; i < n; ++i) {
    double t = std::cos(std::numbers::pi * (i + 0.75) / (n + 0.5)), slope = 1.0;
    for (int step = 0; step < 100; ++step) {
      const auto [now, before] = calc_legendre_pair(n, t);
      slope = n * (t * now - before) / (t * t - 1.0);
      const double change = now / slope;
      t -= change;
      if (std::abs(change) < 1e-16) break;
    }
    rule.x.push_back(0.5 * (1.0 - t));
    rule.weight.push_back(1.0 / ((1.0 - t * t) * slope * slope));
  }
  return rule;
}

std::vector<double> make_lobatto_points(int n) {
  if (n == 0) return {0.5};
  std::vector<double> points{0.0};
  for (int i = 1; i < n; ++i) {
    double t = -std::cos(std::numbers::pi * i / n);
    for (int step = 0; step < 100; ++step) {
      const auto [now, before] = calc_legendre_pair(n, t);
      // Newton's method on P_n', whose derivative follows from Legendre's equation.
      const double slope = n * (before - t * now) / (1.0 - t * t), bend = (2.0 * t * slope - n * (n + 1) * now) / (1.0 - t * t);
      const double change = slope / bend;
      t -= change;
      if (std::abs(change) < 1e-16) break;
    }
    points.push_back(0.5 * (1.0 + t));
  }
  points.push_back(1.0);
  return points;
}

la::Matrix calc_products(int n, int a, int b) {
  const GaussRule rule = make_gauss_rule(n + 1);
  la::Matrix left(n, rule.x.size()), right(n, rule.x.size());
  for (std::size_t q = 0; q < rule.x.size(); ++q) {
    left.col(static_cast<Eigen::Index>(q)) = rule.weight[q] * calc_legendre(n, rule.x[q], a);
    right.col(static_cast<Eigen::Index>(q)) = calc_legendre(n, rule.x[q], b);
  }
  return left * right.transpose();
}

la::Matrix calc_weighted(int n, int order) {
  const GaussRule rule = make_gauss_rule(n + 1);
  la::Matrix values(rule.x.size(), n);
  for (std::size_t q = 0; q < rule.x.size(); ++q)
    values.row(static_cast<Eigen::Index>(q)) = std::sqrt(rule.weight[q]) * calc_legendre(n, rule.x[q], order).transpose();
  return values;
}

la::Matrix make_conditioned_basis(int n, const std::array<EndConditions, 2>& ends) {
  std::vector<la::Vector> rows;
  for (int end = 0; end < 2; ++end) {
    if (ends[end].has_value) rows.push_back(calc_legendre(n, end, 0));
    if (ends[end].has_slope) rows.push_back(calc_legendre(n, end, 1));
  }
  return make_null_space(n, rows);
}

la::Matrix make_null_space(int n, const std::vector<la::Vector>& conditions) {
  if (conditions.empty()) return la::Matrix::Identity(n, n);
  la::Matrix columns(n, conditions.size());
  for (std::size_t r = 0; r < conditions.size(); ++r) columns.col(static_cast<Eigen::Index>(r)) = conditions[r].normalized();
  return la::calc_qr(columns, n).q.rightCols(n - static_cast<int>(conditions.size()));
}

}  // namespace carillon::analytic

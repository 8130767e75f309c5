// Legendre polynomials on [0, 1]: spaces with end conditions, and their integrals.
#pragma once

#include <array>
#include <vector>

#include "precompute/la/lapack.hpp"

namespace carillon::analytic {

/// Values of P_0 .. P_(n-1) of 2 x - 1, orthonormal on [0, 1], or their derivatives of order 1 or 2.
la::Vector calc_legendre(int n, double x, int order = 0);

/// Gauss-Legendre points and weights on [0, 1], exact to degree 2 n - 1.
struct GaussRule {
  std::vector<double> x, weight;
};
GaussRule make_gauss_rule(int n);

/// The n + 1 Gauss-Lobatto points on [0, 1], ascending: the ends and the zeros of P_n'; the middle for n = 0.
std::vector<double> make_lobatto_points(int n);

/// Integrals over [0, 1] of products of derivatives, (n, n): entry (i, j) of P_i^(a) P_j^(b).
la::Matrix calc_products(int n, int a, int b);

/// Vanishing derivatives at an end: deflection, slope.
struct EndConditions {
  bool has_value = false, has_slope = false;
};

/// Derivatives of that order at Gauss points times the square roots of their weights, (n + 1, n): A^T A is calc_products(n, order, order).
la::Matrix calc_weighted(int n, int order);

/// Columns: an orthonormal basis of the polynomials of degree below n that meet the conditions at 0 and at 1.
la::Matrix make_conditioned_basis(int n, const std::array<EndConditions, 2>& ends);

/// Columns: an orthonormal basis of the n-vectors orthogonal to all conditions.
la::Matrix make_null_space(int n, const std::vector<la::Vector>& conditions);

}  // namespace carillon::analytic

// Legendre polynomials on [0, 1]: spaces with conditions at the ends, and their integrals.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "precompute/la/lapack.hpp"

namespace carillon::analytic {

/// Values of P_0 .. P_(n-1) of 2 x - 1, made orthonormal on [0, 1], or of their derivative of that order (0, 1 or 2).
la::Vector calc_legendre(int n, double x, int order = 0);

/// Points and weights of Gauss and Legendre on [0, 1], exact to degree 2 n - 1.
struct GaussRule {
  std::vector<double> x, weight;
};
GaussRule make_gauss_rule(int n);

/// The n + 1 points of Gauss and Lobatto on [0, 1], ascending: the ends, and where the derivative of P_n vanishes; of n = 0 the middle.
std::vector<double> make_lobatto_points(int n);

/// Integrals over [0, 1] of products of derivatives, (n, n): entry (i, j) of P_i^(a) P_j^(b).
la::Matrix calc_products(int n, int a, int b);

/// Which derivatives vanish at an end: the deflection, the slope.
struct EndConditions {
  bool has_value = false, has_slope = false;
};

/// Derivatives of that order at Gauss points times the roots of their weights, (n + 1, n): A^T A is calc_products(n, order, order).
la::Matrix calc_weighted(int n, int order);

/// Columns: an orthonormal basis of the polynomials of degree below n that meet the conditions at 0 and at 1.
la::Matrix make_conditioned_basis(int n, const std::array<EndConditions, 2>& ends);

/// Columns: an orthonormal basis of the vectors of n numbers that are orthogonal to each of the conditions.
la::Matrix make_null_space(int n, const std::vector<la::Vector>& conditions);

}  // namespace carillon::analytic

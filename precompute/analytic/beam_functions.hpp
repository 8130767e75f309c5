// Bending of a uniform Euler-Bernoulli beam: roots and shapes for all pairs of end conditions.
#pragma once

#include <array>
#include <vector>

#include "precompute/job/analytic_body.hpp"

namespace carillon::analytic {

/// w(x) of one mode on 0 <= x <= 1 with w'''' = beta^4 w and unit mean square:
///   w = A cos(beta x) + B sin(beta x) + C exp(-beta x) + D exp(-beta (1 - x)).
/// Exponentials instead of cosh and sinh keep full precision for every mode number.
struct BeamFunction {
  double beta = 0.0;
  std::array<double, 4> coefficients{};

  /// Derivative of order 0 to 3, over beta^order.
  double calc(double x, int order = 0) const;
};

/// Number of rigid motions that the ends allow: 0, 1 or 2.
int count_mechanisms(const std::array<job::Edge, 2>& ends);

/// Roots beta <= `max_beta`, ascending, without mechanisms: of cos cosh = +-1, tan = +-tanh, sin = 0, cos = 0 (Rayleigh, The Theory of
/// Sound, sections 170 to 174).
std::vector<double> find_beam_roots(const std::array<job::Edge, 2>& ends, double max_beta);

/// Shape of a root.
BeamFunction make_beam_function(const std::array<job::Edge, 2>& ends, double beta);

}  // namespace carillon::analytic

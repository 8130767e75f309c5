// Bending of a uniform beam by Euler and Bernoulli: roots and shapes for any two ends.
#pragma once

#include <array>
#include <vector>

#include "precompute/job/analytic_body.hpp"

namespace carillon::analytic {

/// w(x) of one mode on 0 <= x <= 1 with w'''' = beta^4 w and unit mean square:
///   w = A cos(beta x) + B sin(beta x) + C exp(-beta x) + D exp(-beta (1 - x)).
/// cosh and sinh written this way lose no digits, whatever the number of the mode.
struct BeamFunction {
  double beta = 0.0;
  std::array<double, 4> coefficients{};

  /// The derivative of that order (0 to 3), over beta^order.
  double calc(double x, int order = 0) const;
};

/// Motions of the line that leave both ends free of force: 0, 1 or 2.
int count_mechanisms(const std::array<job::Edge, 2>& ends);

/// The first roots beta up to `max_beta`, ascending, without the mechanisms: of cos cosh = +-1, tan = +-tanh, sin = 0, cos = 0 (Rayleigh,
/// The Theory of Sound, sections 170 to 174).
std::vector<double> find_beam_roots(const std::array<job::Edge, 2>& ends, double max_beta);

/// The shape for a root.
BeamFunction make_beam_function(const std::array<job::Edge, 2>& ends, double beta);

}  // namespace carillon::analytic

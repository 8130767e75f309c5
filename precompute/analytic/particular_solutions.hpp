// Eigenvalues of a polygon's membrane to all digits, by particular solutions.
#pragma once

#include <optional>
#include <vector>

#include "precompute/analytic/slabs.hpp"

namespace carillon::analytic {

/// The method of Fox, Henrici and Moler (1967), in the form of Betcke and Trefethen (2005): u = sum c_k sin(k alpha theta) J_(k
/// alpha)(kappa^1/2 r) about one corner of angle pi / alpha solves the equation and vanishes on its two sides; where the least angle
/// between such sums and the functions that vanish on the other sides is zero, kappa is an eigenvalue. Sums converge exponentially where
/// all other corners have angles pi / n.
class ParticularSolutions {
 public:
  /// None where two corners or more have other angles.
  static std::optional<ParticularSolutions> make(const std::vector<Point2>& corners_m);

  struct Refined {
    double kappa = 0.0;
    double error = 0.0;  // relative, an estimate
    double sine = 0.0;   // of the least angle there: zero but for rounding, if kappa is an eigenvalue
  };
  /// The eigenvalue nearest to an estimate whose relative error is at most `error`; of a group of `multiplicity` equal ones all at once.
  /// None where the sums do not reach it.
  std::optional<Refined> refine(double kappa, double error, int multiplicity) const;

  /// The `rank`-th sine of the angles (1: the least).
  double calc_sine(double kappa, int rank = 1) const;

 private:
  ParticularSolutions() = default;
  std::vector<Point2> rim_, inside_;  // (radius, angle) about the corner
  double alpha_ = 1.0, reach_ = 1.0;  // reach: the largest radius
};

}  // namespace carillon::analytic

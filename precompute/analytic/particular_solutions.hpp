// Eigenvalues of a polygonal membrane to full precision, by the method of particular solutions.
#pragma once

#include <optional>
#include <vector>

#include "precompute/analytic/slabs.hpp"

namespace carillon::analytic {

/// Fox, Henrici and Moler (1967), in the form of Betcke and Trefethen (2005): u = sum c_k sin(k alpha theta) J_(k alpha)(kappa^1/2 r) about
/// one corner of angle pi / alpha solves the equation and vanishes on its two sides. kappa is an eigenvalue where the smallest angle
/// between these sums and the functions that vanish on the other sides is zero. Converges exponentially if all other corners have angles pi
/// / n.
class ParticularSolutions {
 public:
  /// nullopt if two or more corners have other angles.
  static std::optional<ParticularSolutions> make(const std::vector<Point2>& corners_m);

  struct Refined {
    double kappa = 0.0;
    double error = 0.0;  // relative, an estimate
    double sine = 0.0;   // of the smallest angle there: zero up to rounding at an eigenvalue
  };
  /// Eigenvalue nearest to an estimate with relative error at most `error`; of a group of `multiplicity` equal ones all at once. nullopt if
  /// the sums do not converge to it.
  std::optional<Refined> refine(double kappa, double error, int multiplicity) const;

  /// The `rank`-th smallest sine of the angles (from 1).
  double calc_sine(double kappa, int rank = 1) const;

 private:
  ParticularSolutions() = default;
  std::vector<Point2> rim_, inside_;  // (radius, angle) about the corner
  double alpha_ = 1.0, reach_ = 1.0;  // reach: the largest radius
};

}  // namespace carillon::analytic

// The longest step at which the motion is stable.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/simulation/transient/domain.hpp"

namespace carillon::transient {

/// The longest step [s] of a mode of omega [rad/s] whose damping force is that of the velocity half a step before:
/// (2 / omega) (sqrt(1 + xi^2) - xi), xi = (alpha1 omega + alpha2 / omega) / 2. Infinite for omega = 0.
double calc_longest_step(double omega_rad_s, double alpha1_s, double alpha2_per_s);

/// alpha1 [s] of a law: the most that damping is of stiffness, over all strains.
double calc_alpha1(const Law& law);

/// Highest frequency of each body by power iterations on M^-1 K, K from differences of the forces about the shape as it is. Keeps its
/// vectors, from which the next call continues. The same bits on any number of ranks.
class HighestFrequency {
 public:
  explicit HighestFrequency(const Domain& domain);

  /// [rad/s] (bodies), from below. u: (Domain::node_count) with its halo. fixed: (own_count) nodes whose displacement is prescribed.
  /// Collective.
  std::vector<double> calc(Domain& domain, const Quad* u, const std::vector<char>& fixed, int iterations);

  std::vector<Quad>& get_vectors() { return p_; }  // (node_count), own ones count

 private:
  std::vector<Quad> p_, moved_, f_, g_;
  std::vector<double> shortest_edge_m_;  // (bodies)
};

}  // namespace carillon::transient

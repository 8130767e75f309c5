// Longest stable step.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/simulation/transient/domain.hpp"

namespace carillon::transient {

/// Longest stable step [s] for a mode of omega [rad/s] with damping force from the velocity half a step earlier: (2 / omega) (sqrt(1 +
/// xi^2) - xi), xi = (alpha1 omega + alpha2 / omega) / 2. Infinite for omega = 0.
double calc_longest_step(double omega_rad_s, double alpha1_s, double alpha2_per_s);

/// alpha1 [s] of a law: largest ratio of damping to stiffness, over all strains.
double calc_alpha1(const Law& law);

/// Highest frequency of each body by power iterations on M^-1 K, with K from force differences about the current shape. Keeps its vectors
/// for the next call. Bit-identical on any number of ranks.
class HighestFrequency {
 public:
  explicit HighestFrequency(const Domain& domain);

  /// [rad/s] (bodies), lower bounds. u: (Domain::node_count) with its halo. fixed: (own_count) nodes with prescribed displacement.
  /// Collective.
  std::vector<double> calc(Domain& domain, const Quad* u, const std::vector<char>& fixed, int iterations);

  std::vector<Quad>& get_vectors() { return p_; }  // (node_count), own entries valid

 private:
  std::vector<Quad> p_, moved_, f_, g_;
  std::vector<double> shortest_edge_m_;  // (bodies)
};

}  // namespace carillon::transient

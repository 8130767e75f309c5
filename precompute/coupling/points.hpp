// Few points of a body at which the coupling of its modes can be summed up.
#pragma once

#include <vector>

#include "precompute/coupling/stresses.hpp"

namespace carillon::coupling {

/// P points: eta_r = sum over p of weight_p stress_rp . strain_p, as bank::QuarticEnergy has it for solids. Rank 0.
struct CouplingPoints {
  la::Matrix gradient;  // (9 P, N), row 9 p + 3 k + a
  la::Matrix stress;    // (6 P, R)
  la::Vector weight;    // (P)
  double error = 0;     // of the energy on the tests: see calc_error()
};

/// Chooses points of integration by least squares with weights that are not negative, so that the sums are those of the fields on motions
/// drawn at random; then fits the stress at the points. As many points as `error` wants, `most` at most; error says whether that was
/// enough. fields: with values. Collective; empty but on rank 0.
CouplingPoints choose_points(const CoupledBody& body, const mesh::LocalMesh& local, const StressFields& fields, double error,
                             std::ptrdiff_t most);

}  // namespace carillon::coupling

// Error bars of frequencies: cents per mode, in two parts. Definition and validation: docs/error-bars.md.
#pragma once

#include <mpi.h>
#include <petscmat.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/fem/error_bars/correct.hpp"
#include "precompute/job/job_spec.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"

namespace carillon::error_bars {

/// Material data of an estimate.
struct Solid {
  std::array<double, 36> elasticity_pa{};  // C, (6, 6) row-major, Voigt order xx yy zz yz xz xy, engineering shear strains, mesh axes
  double density_kg_m3 = 0.0;
};

/// Computed modes, as in eigen::Modes.
struct Solution {
  std::span<const double> lambda;    // (m) [rad^2/s^2], ascending; no rigid modes
  std::span<const double> residual;  // (m) || K phi - lambda M phi ||_2 / (lambda || M phi ||_2)
  Mat shapes = nullptr;              // (3n, m) dense, phi^T M phi = 1; null when m is 0
  double low_hz = 0.0;               // ends of the complete band (proven by a count); they close the gaps of the
  double high_hz = 0.0;              // first and the last mode. high_hz: where the list was cut (max_modes), its last frequency
  std::int64_t below = 0;            // elastic modes below low_hz, counted
};

/// Error bars, one entry per mode, the same on every rank. A bar b: the true frequency of the k-th mode lies between f_k 2^(-b/1200) and
/// f_k 2^(b/1200).
struct ErrorBars {
  /// Algebraic: distance to the frequency of K phi = lambda M phi, k-th against k-th: a bound from the residual (Kato and Temple) plus
  /// rounding in K.
  std::vector<double> algebraic_cents;
  /// Discretisation: distance between the frequencies of K phi = lambda M phi and of the elastic body: an estimate with safety factor, for
  /// the k-th of the sorted frequencies even if modes change order or enter the list. k counts elastic modes below the band too. Infinite
  /// if is_too_short().
  std::vector<double> discretisation_cents;
  /// Estimated additional error of the k-th frequency if the facets are of the other kind (planes, or samples of a smooth surface).
  /// Independent of the mesh and not part of any bar. Empty: no ambiguous facets.
  std::vector<double> facet_cents;

  Level level;  // input of the bars: for predictions and reports

  /// Corrected frequencies and their bars.
  Corrections corrected;
};

/// Calculates the error bars of all modes from K, M and the modes, in one pass over the elements. solids: by material; material_of_tet: (e)
/// index into solids, may be empty for one material. stiffness, mass: those of fem::System. Independent of the number of ranks up to
/// rounding. Collective. Throws InputError for inconsistent arguments, SystemError when out of memory; on all ranks alike.
ErrorBars calc_error_bars(const comm::Communicator& comm, const mesh::LocalMesh& local, Mat stiffness, Mat mass,
                          std::span<const Solid> solids, std::span<const std::int32_t> material_of_tet, job::Mass mass_kind,
                          const Solution& solution);

}  // namespace carillon::error_bars

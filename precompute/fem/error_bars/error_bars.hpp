// How wrong each frequency can be: an error bar in cents per mode, in two parts. docs/error-bars.md says what they mean and how good they
// are.
#pragma once

#include <mpi.h>
#include <petscmat.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/fem/error_bars/correct.hpp"
#include "precompute/job/job_spec.hpp"

namespace carillon::error_bars {

/// What an estimate must know of a material.
struct Solid {
  std::array<double, 36> elasticity_pa{};  // C, (6, 6) row-major, Voigt's order xx yy zz yz xz xy, engineering shear strains, mesh axes
  double density_kg_m3 = 0.0;
};

/// The computed modes, as in eigen::Modes.
struct Solution {
  std::span<const double> lambda;    // (m) [rad^2/s^2], ascending; no rigid modes
  std::span<const double> residual;  // (m) || K phi - lambda M phi ||_2 / (lambda || M phi ||_2)
  Mat shapes = nullptr;              // (3n, m) dense, phi^T M phi = 1; null when m is 0
  double low_hz = 0.0;               // ends of the band in which the modes are complete (proven by a count): they close the gaps of the
  double high_hz = 0.0;              // first and the last mode. high_hz: where the list was cut (max_modes), its last frequency
  std::int64_t below = 0;            // elastic modes below low_hz, counted
};

/// Error bars, one entry a mode, the same on every rank. A bar b says that the true frequency of the k-th mode lies between
/// f_k 2^(-b/1200) and f_k 2^(b/1200).
struct ErrorBars {
  /// Between the computed frequency and that of K phi = lambda M phi, k-th against k-th: a bound from the residual (Kato and Temple), and
  /// what rounding in K leaves open.
  std::vector<double> algebraic_cents;
  /// Between the frequency of K phi = lambda M phi and that of the elastic body: an estimate, safety factor included; holds for the k-th of
  /// the sorted frequencies, whatever modes change places, those that are not in the list among them. k counts the elastic modes below the
  /// band too. Infinite where is_too_short().
  std::vector<double> discretisation_cents;
  /// Estimated additional error of the k-th frequency if the facets, taken as planes or as samples of a smooth surface, are the other kind.
  /// Independent of the mesh and not part of any bar. Empty: no facets in doubt.
  std::vector<double> facet_cents;

  Level level;  // their input: for predictions and reports

  /// The same for corrected frequencies.
  Corrections corrected;
};

/// Calculates the error bars of all modes from K, M and the modes, in one pass over the elements.
/// solids: by material; material_of_tet: (e) index into solids, may be empty when there is one. stiffness, mass: those of fem::System.
/// Results do not depend on the number of ranks beyond rounding. Collective. Throws InputError when the arguments do not fit one another,
/// SystemError when memory runs out; on all ranks alike.
ErrorBars calc_error_bars(const comm::Communicator& comm, const mesh::LocalMesh& local, Mat stiffness, Mat mass,
                          std::span<const Solid> solids, std::span<const std::int32_t> material_of_tet, job::Mass mass_kind,
                          const Solution& solution);

/// The elasticity of an isotropic solid.
Solid make_isotropic(double young_modulus_pa, double poisson_ratio, double density_kg_m3);

}  // namespace carillon::error_bars

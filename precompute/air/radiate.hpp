// Radiation of the modes of a bank by boundary elements.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "precompute/air/solve.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::air {

/// Rigid reflecting plane; the normal points to the side of the body.
struct Plane {
  Vec3 point_m{};
  Vec3 normal{};  // unit
};

struct AirOptions {
  AirSolveOptions solve;
  double air_density_kg_m3 = bank::kAirDensityKgM3;
  double sound_speed_ms = bank::kSoundSpeedMs;
  std::optional<Plane> half_space;
  std::size_t most_nodes = 0;  // surfaces with more nodes are coarsened
  /// Returns a closed surface with about so many nodes and the same volume. Rank 0 only; may be empty: no coarsening.
  std::function<std::pair<std::vector<Vec3>, std::vector<Triangle>>(const std::vector<Vec3>&, const std::vector<Triangle>&, std::size_t)>
      coarsen;
  std::function<void(const std::string&)> warn;  // one-line warning, rank 0; may be empty
  double order_db = -46.0;                       // truncation error of the multipole order, at the nearest distance and in the far field
};

/// Added mass relative to modal mass: modes above kShiftMass are shifted; if one mode reaches kCoupleMass, all modes are coupled; above
/// kMostMass the in-vacuo modes of the bank no longer span the modes in air.
inline constexpr double kShiftMass = 0.01, kCoupleMass = 0.1, kMostMass = 1.0;

/// Facets per wavelength of the highest mode: error below the first, warning below the second.
inline constexpr double kFewestFacets = 1.0, kFewFacets = 2.0;

/// Outer surface of the bank with the normal velocities of all modes, at the wave numbers of the playback frequencies, followed by the
/// rigid motions of a free body. `freq_hz`: of the modes. Throws InputError if the surface has no outside or is too coarse for the waves.
/// Rank 0 only.
Radiator make_radiator(const bank::Bank& bank, std::span<const double> freq_hz, const AirOptions& options);

/// The same without rigid motions.
Radiator leave_out_rigid(const Radiator& radiator);

/// Upper bound on a mode's added mass without cavity resonances: that of a sphere around the body, all of it moving in phase. From
/// kCoupleMass on, modes may need coupling.
double calc_mass_bound(const Radiator& radiator, const AirOptions& options);

/// Playback frequencies: corrected ones if present.
std::vector<double> find_played_freq_hz(const bank::Bank& bank);

/// Multipoles of all modes of `bank` (rank 0 only), with the resulting damping and added mass. Modes with added mass >= kShiftMass are
/// solved at their frequency in air; if one reaches kCoupleMass, all modes are coupled with each other and with the rigid motions of a free
/// body, and the multipoles are those of the mixtures. `answers`: file of solved wave numbers from which a run resumes, removed at the end;
/// empty: none. Collective. Throws on all ranks as solve_air(), and InputError above kMostMass (membranes).
bank::Multipoles calc_multipoles(const comm::Communicator& comm, const bank::Bank& bank, const AirOptions& options, Keeper keeper = {},
                                 const std::filesystem::path& answers = {});

/// Compactness 36 pi V^2 / A^3 of the outer surface: 1 for a sphere, 0.52 for a cube, 0.02 for a plate. Decides between boundary elements
/// and the equivalent sphere.
double calc_roundness(const bank::Bank& bank);
/// "auto" uses boundary elements below it.
inline constexpr double kCompact = 0.4;

}  // namespace carillon::air

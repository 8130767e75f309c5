// From a bank to what its modes send into the air.
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

/// A rigid plane that reflects; the body is on the side that the normal shows to.
struct Plane {
  Vec3 point_m{};
  Vec3 normal{};  // unit
};

struct AirOptions {
  AirSolveOptions solve;
  double air_density_kg_m3 = bank::kAirDensityKgM3;
  double sound_speed_ms = bank::kSoundSpeedMs;
  std::optional<Plane> half_space;
  std::size_t most_nodes = 0;  // of the surface, where it is coarsened; one that has more is
  /// Gives a closed surface about so many nodes, and keeps its volume. Rank 0 alone; may be empty: no surface is coarsened.
  std::function<std::pair<std::vector<Vec3>, std::vector<Triangle>>(const std::vector<Vec3>&, const std::vector<Triangle>&, std::size_t)>
      coarsen;
  std::function<void(const std::string&)> warn;  // one line, of rank 0; may be empty
  double order_db = -46.0;                       // what the orders that are left out make, at the nearest distance and far away
};

/// From this added mass on a mode is shifted; where one mode of a bank reaches the second, all of them are coupled by the air; beyond the
/// third, modes of the body without air, and as many as the bank has, no longer make up those in air.
inline constexpr double kShiftMass = 0.01, kCoupleMass = 0.1, kMostMass = 1.0;

/// Facets per wavelength of the fastest mode: fewer than the first are refused, fewer than the second warned of.
inline constexpr double kFewestFacets = 1.0, kFewFacets = 2.0;

/// The surface of the bank that faces the open air, with the normal velocities of all modes on it, at the wave numbers of the frequencies
/// that are played, and after them the rigid motions of one free body. `freq_hz`: of the modes. Throws InputError where the surface has no
/// outside, and where it is too coarse for the waves. Rank 0 alone.
Radiator make_radiator(const bank::Bank& bank, std::span<const double> freq_hz, const AirOptions& options);

/// The same with the modes alone.
Radiator leave_out_rigid(const Radiator& radiator);

/// The largest added mass that a mode can have without a resonance of the air: a sphere around the body, all of whose surface moves in
/// step, has it. Where it reaches kCoupleMass, modes may have to be coupled.
double calc_mass_bound(const Radiator& radiator, const AirOptions& options);

/// The frequencies at which a bank is played: corrected ones where it has them.
std::vector<double> find_played_freq_hz(const bank::Bank& bank);

/// Multipoles of all modes of `bank`, which rank 0 alone has and gets; damping and added mass from them. Modes whose added mass is
/// kShiftMass or more are solved at their frequency in air; where one has kCoupleMass, all modes are coupled, with each other and with the
/// rigid motions of a free body, and the multipoles are those of the mixtures. Collective. Throws on all ranks as solve_air(), and
/// InputError where the added mass is above kMostMass: a membrane needs another method.
/// `answers`: a file in which wave numbers that are solved are kept, and from which a run resumes; empty: none. It is gone at the end.
bank::Multipoles calc_multipoles(const comm::Communicator& comm, const bank::Bank& bank, const AirOptions& options, Keeper keeper = {},
                                 const std::filesystem::path& answers = {});

/// What decides whether a body needs boundary elements, or the sphere of the same surface does: how much of the volume of that sphere the
/// outer surface encloses, squared: 36 pi V^2 / A^3, 1 for a sphere, 0.52 for a cube, 0.02 for a plate.
double calc_roundness(const bank::Bank& bank);
/// Below it, "auto" takes boundary elements.
inline constexpr double kCompact = 0.4;

}  // namespace carillon::air

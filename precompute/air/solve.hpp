// Solution of the exterior air for all modes of a body.
#pragma once

#include <complex>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "precompute/air/coupling.hpp"
#include "precompute/air/surface.hpp"
#include "precompute/comm/communicator.hpp"

namespace carillon::air {

/// Geometry and motions; rank 0's is broadcast. n motions: modes, then rigid motions, which have no wave number and take part only in
/// coupling.
struct Radiator {
  std::vector<Vec3> nodes_m;
  std::vector<Triangle> triangles;
  std::vector<float> velocity;          // (T, 3, n) normal velocity at the corners for unit modal velocity [kg^-1/2]
  std::vector<double> wave_number_1_m;  // of each mode
  Sphere sphere{};                      // encloses the nodes; origin of the multipoles

  std::size_t rigid = 0;  // motions

  std::size_t count_modes() const { return wave_number_1_m.size(); }
  std::size_t count_motions() const { return count_modes() + rigid; }
};

/// Coupling of the modes by the air.
struct CouplingOptions {
  double density_kg_m3 = 0.0;  // the added mass between two motions is - density Re integral of p of one times v of the other
  /// On rank 0, from uncoupled modes at their own wave numbers: true if they must be coupled. May throw.
  std::function<bool(const std::vector<struct Sounding>&)> is_called_for{};
  bool has_rows = false;  // store the rows that coupling needs; otherwise a solve that needs them stops with lacks_rows
  double kept = 1e-3;     // omit motions below this fraction of a mode's largest part
  double settled = 2e-5;  // relative tolerance of k between a mode and its solution
};

struct AirSolveOptions {
  double step = 0.75;                // mean step of k R between wave numbers
  double error_db = -40.0;           // maximum interpolation error of any mode
  double nearest_over_radius = 2.0;  // nearest listening distance in radii
  double tolerance = 1e-4;           // GMRES
  /// Wave number of a mode in air from its in-vacuo solution; empty: unshifted.
  std::function<double(double k, const struct Sounding&)> shift;
  std::optional<CouplingOptions> coupling;  // nullopt: uncoupled modes
  double matrix_bytes = 1073741824.0;       // per rank; above it, ranks share a wave number
};

/// One mode at one wave number, with dp/dn = v.
struct Answer {
  std::int32_t order = 0;
  std::vector<std::complex<float>> coefficient;  // (order + 1)^2: c_lm |h_l(k R)|
  std::complex<double> reaction;                 // integral of p v over the surface
  std::vector<std::complex<float>> row;          // (n) or empty: integral of p times the velocity of each motion
};

/// Solutions of the requested modes at one wave number; saved between runs.
struct WaveAnswer {
  double k = 0.0;
  std::map<std::int32_t, Answer> modes;
  std::int32_t products = 0;  // of GMRES
  double residual = 0.0;
};

/// Serialisation as numbers, for files and messages.
std::vector<double> pack(const WaveAnswer& answer);
/// nullopt if the numbers are not a valid answer.
std::optional<WaveAnswer> unpack(std::span<const double> packed);

/// Storage of answers for resumed runs; any function may be empty. Rank 0.
struct Keeper {
  std::function<std::vector<WaveAnswer>()> read;
  std::function<void(const WaveAnswer&)> save;
  /// "wave number 12 of 40": after each, with the fraction done.
  std::function<void(const std::string&, double)> report;
  /// True: stop and throw SolveStopped on all ranks.
  std::function<bool()> is_stop_asked;
};

struct SolveStopped {};

/// One mode in the air, at its own wave number, for unit modal velocity q' and dp/dn = v.
struct Sounding {
  std::int32_t order = 0;
  std::vector<std::complex<double>> coefficient;  // (order + 1)^2: c_lm |h_l(k R)|
  std::complex<double> reaction;
  Mixture mixture;                   // empty if modes are uncoupled
  double interpolation_db = -300.0;  // estimate of wave_numbers.hpp, the larger of far field and nearest distance
};

struct AirSolution {
  Sphere sphere;
  std::vector<Sounding> modes;          // (n)
  std::vector<double> wave_number_1_m;  // (n) at which they were solved
  bool lacks_rows = false;              // coupling is required but CouplingOptions::has_rows is false
  double unsettled = 0.0;               // coupled modes: largest |k - k solved| / k
  double reciprocity = 0.0;             // coupled modes: largest |m_ij - m_ji| of the air masses over sqrt(m_ii m_jj)
  std::size_t unknowns = 0;
  std::size_t wave_numbers = 0;
  std::int32_t products = 0;  // largest number of GMRES products of a wave number
  double residual = 0.0;      // largest
};

/// Solves the air for all modes. Wave numbers are distributed over groups of ranks; the result has the same bits on any number of ranks.
/// Collective; the solution is on rank 0. Throws on all ranks: InputError for an invalid surface, SolveError if GMRES and LU fail,
/// SolveStopped.
AirSolution solve_air(const comm::Communicator& comm, const Radiator& radiator, const AirSolveOptions& options, const Keeper& keeper = {});

/// Expansion order for k R.
std::int32_t find_order(double k_radius);

}  // namespace carillon::air

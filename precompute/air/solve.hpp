// The air outside a body, for all of its modes.
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

/// What moves, and how: rank 0's is broadcast. n motions: modes, and after them rigid motions, which have no wave number and come in where
/// modes are coupled.
struct Radiator {
  std::vector<Vec3> nodes_m;
  std::vector<Triangle> triangles;
  std::vector<float> velocity;          // (T, 3, n) normal velocity at the corners for unit modal velocity [kg^-1/2]
  std::vector<double> wave_number_1_m;  // of each mode
  Sphere sphere{};                      // around the nodes: the multipoles are about its centre

  std::size_t rigid = 0;  // motions

  std::size_t count_modes() const { return wave_number_1_m.size(); }
  std::size_t count_motions() const { return count_modes() + rigid; }
};

/// Whether the air couples the modes of a radiator, and how.
struct CouplingOptions {
  double density_kg_m3 = 0.0;  // the added mass between two motions is - this times Re of the integral of p of one times v of the other
  /// On rank 0, of modes alone at their own wave numbers: whether they are to be coupled. May throw.
  std::function<bool(const std::vector<struct Sounding>&)> is_called_for{};
  bool has_rows = false;  // what coupling needs is kept of each solve; else a solve that calls for it ends there, with lacks_rows
  double kept = 1e-3;     // motions with less than this of the largest part of a mode are left out of it
  double settled = 2e-5;  // of k: how far a mode may be from where it was solved
};

struct AirSolveOptions {
  double step = 0.75;                // mean step of k R between wave numbers
  double error_db = -40.0;           // that interpolation may make in any mode; more wave numbers where it makes more
  double nearest_over_radius = 2.0;  // from where on, in radii
  double tolerance = 1e-4;           // of GMRES
  /// The wave number of a mode that the air shifts, from what was found at its own; empty: none is.
  std::function<double(double k, const struct Sounding&)> shift;
  std::optional<CouplingOptions> coupling;  // nothing: modes are alone
  double matrix_bytes = 1073741824.0;       // of one rank; several share a wave number where it takes more
};

/// One mode at one wave number, with dp/dn = v.
struct Answer {
  std::int32_t order = 0;
  std::vector<std::complex<float>> coefficient;  // (order + 1)^2: c_lm |h_l(k R)|
  std::complex<double> reaction;                 // integral of p v over the surface
  std::vector<std::complex<float>> row;          // (n), or empty: of p times the velocity of each motion
};

/// What one wave number gave: the modes that were asked for. What is kept between runs.
struct WaveAnswer {
  double k = 0.0;
  std::map<std::int32_t, Answer> modes;
  std::int32_t products = 0;  // of GMRES
  double residual = 0.0;
};

/// As numbers, for files and messages.
std::vector<double> pack(const WaveAnswer& answer);
/// Nothing where the numbers are no answer.
std::optional<WaveAnswer> unpack(std::span<const double> packed);

/// Where answers are kept, for runs that resume; any of them may be empty. On rank 0.
struct Keeper {
  std::function<std::vector<WaveAnswer>()> read;
  std::function<void(const WaveAnswer&)> save;
  /// "wave number 12 of 40": after each, with the share that is done.
  std::function<void(const std::string&, double)> report;
  /// True: stop, throw SolveStopped on all ranks.
  std::function<bool()> is_stop_asked;
};

struct SolveStopped {};

/// One mode in the air, at its own wave number, for unit modal velocity q' and dp/dn = v.
struct Sounding {
  std::int32_t order = 0;
  std::vector<std::complex<double>> coefficient;  // (order + 1)^2: c_lm |h_l(k R)|
  std::complex<double> reaction;
  Mixture mixture;                   // what moves, where modes are coupled; else empty, and the mode is alone
  double interpolation_db = -300.0;  // error by the rule of wave_numbers.hpp, the larger of far away and at the nearest distance
};

struct AirSolution {
  Sphere sphere;
  std::vector<Sounding> modes;          // (n)
  std::vector<double> wave_number_1_m;  // (n) at which they were solved
  bool lacks_rows = false;              // modes are to be coupled, and that was not prepared: CouplingOptions::has_rows
  double unsettled = 0.0;               // where coupled: the largest distance of a mode from where it was solved, over k
  double reciprocity = 0.0;             // where coupled: largest |m_ij - m_ji| of the air's masses over sqrt(m_ii m_jj)
  std::size_t unknowns = 0;
  std::size_t wave_numbers = 0;
  std::int32_t products = 0;  // of the wave number that took most
  double residual = 0.0;      // the largest
};

/// Solves the air for all modes. Wave numbers are dealt to groups of ranks; the result has the same bits on any number of them. Collective;
/// the solution is rank 0's. Throws on all ranks: InputError for a surface that cannot be, SolveError where an iteration does not converge,
/// SolveStopped.
AirSolution solve_air(const comm::Communicator& comm, const Radiator& radiator, const AirSolveOptions& options, const Keeper& keeper = {});

/// The order up to which fields are expanded at k R.
std::int32_t find_order(double k_radius);

}  // namespace carillon::air

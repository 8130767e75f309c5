// The self-equilibrated stresses of pairs of modes, and few fields that span them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/coupling/static_answer.hpp"
#include "precompute/coupling/strains.hpp"

namespace carillon::coupling {

/// What both ways to the fields need. Borrows all.
struct CoupledBody {
  const comm::Communicator& comm;
  const Strains& strains;
  StaticAnswer& answer;
  const Nodal& shapes;               // (local nodes, 3, N) of the kept modes
  const std::vector<double>& omega;  // (N) [rad/s]
  Pairs pairs;
  /// Called before each block of solves, on every rank, with the share that is done; may throw on all ranks alike.
  std::function<void(double)> proceed;
};

/// Motions q of equal energy in all modes: q_i = g_i / omega_i, g_i normal deviates, the same on every rank.
struct Samples {
  la::Matrix q;         // (N, samples) [m kg^1/2]
  la::Matrix products;  // (pairs, samples): q_i q_j
};
Samples make_samples(const std::vector<double>& omega, int count, std::uint64_t seed);
/// The motions of one mode each.
Samples make_single_samples(const std::vector<double>& omega);
Samples join(const Samples& a, const Samples& b);
/// (pairs) units in which all modes have the same energy: what a pair's products are multiplied by.
la::Vector calc_pair_scale(const std::vector<double>& omega);

/// R fields of scaled stress (Strains), orthonormal over the body: eta_r(q) = <s_r, E2(q)> = sum over the pairs of form(r, ij) q_i q_j.
/// The condensed energy is 1/2 sum of (linear q + eta)_r² less 1/2 sum of (linear q)_r².
struct StressFields {
  la::Matrix form;       // (R, pairs) [J^1/2 / (m² kg)], fields in the order of what they hold of the energy, with the same in all modes
  la::Matrix linear;     // (R, N) <s_r, eps(phi_i)>; zero of flat bodies
  double curvature = 0;  // calc_curvature() on the tests
  la::Matrix values;     // (rows of this rank, R); empty unless asked for
  std::int64_t solves = 0;
  double error = 0;  // of the energy, as find_rank() measures it
  Samples tests;     // motions of single modes and of all: what the energy is measured on, with its
  la::Vector full;   // (tests) quartic energy of all fields [J]
  la::Vector cubic;  // (tests) <eps(q), s(q)> [J]
};

/// The root of the largest part of the linear energy of a motion that lies in the fields: 0 of a flat body, 1 where all of it does. Of the
/// fields only the directions count that hold all but `error` of the energy of some motions: in others the mesh, which is never quite
/// symmetric, is as large as the body. linear: (R, N); eta: (R, motions).
double calc_curvature(const la::Matrix& linear, const la::Matrix& eta, const std::vector<double>& omega, double error);
/// From here on a body is curved. A flat one has up to half of it by its mesh; what it does to the pitch goes with its square.
inline constexpr double kCurved = 0.02;

/// The largest error of energies of motions: relative to each, or to a hundredth of their mean, where that is more; and that of the cubic
/// part in the mean square.
double calc_error(const la::Vector& energy, const la::Vector& cubic, const la::Vector& full, const la::Vector& full_cubic);

/// The least number of leading fields whose error on the tests is at most `error`, which becomes theirs: see calc_error().
std::ptrdiff_t find_rank(const StressFields& fields, double& error);

/// G_(ij)(kl) = <E_ij, C E_kl> - f_ij^T K^-1 f_kl, in the form <s_ij, s_kl> with s_ij = E_ij - eps(theta_ij): positive semidefinite but for
/// rounding. work (N, pairs): <eps(phi), s_ij>.
struct Gram {
  la::Matrix values;  // (pairs, pairs)
  la::Matrix work;
  Nodal theta;  // (local nodes, 3, pairs)
};
Gram calc_gram(const CoupledBody& body);

/// All pairs are condensed: one solve each. error: of the energy, at most. Collective.
StressFields calc_fields_of_pairs(const CoupledBody& body, double error, bool wants_values);

/// Random motions are condensed until those that were not used are spanned (a randomised range finder): about R solves. Collective.
StressFields calc_fields_of_samples(const CoupledBody& body, double error);

}  // namespace carillon::coupling

// Self-equilibrated stresses of pairs of modes, and a small basis of them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/coupling/static_answer.hpp"
#include "precompute/coupling/strains.hpp"

namespace carillon::coupling {

/// Input of both methods. Non-owning.
struct CoupledBody {
  const comm::Communicator& comm;
  const Strains& strains;
  StaticAnswer& answer;
  const Nodal& shapes;               // (local nodes, 3, N) of the kept modes
  const std::vector<double>& omega;  // (N) [rad/s]
  Pairs pairs;
  /// Called on every rank before each block of solves, with the fraction done; may throw on all ranks alike.
  std::function<void(double)> proceed;
};

/// Motions q of equal energy in all modes: q_i = g_i / omega_i, g_i normal deviates, the same on every rank.
struct Samples {
  la::Matrix q;         // (N, samples) [m kg^1/2]
  la::Matrix products;  // (pairs, samples): q_i q_j
};
Samples make_samples(const std::vector<double>& omega, int count, std::uint64_t seed);
/// Motions of one mode each.
Samples make_single_samples(const std::vector<double>& omega);
Samples join(const Samples& a, const Samples& b);
/// (pairs) factors of the pairs' products in units of equal modal energy.
la::Vector calc_pair_scale(const std::vector<double>& omega);

/// R fields of scaled stress (Strains), orthonormal over the body: eta_r(q) = <s_r, E2(q)> = sum over the pairs of form(r, ij) q_i q_j. The
/// condensed energy is 1/2 sum of (linear q + eta)_r² less 1/2 sum of (linear q)_r².
struct StressFields {
  la::Matrix form;       // (R, pairs) [J^1/2 / (m² kg)], fields in decreasing order of energy at equal modal energies
  la::Matrix linear;     // (R, N) <s_r, eps(phi_i)>; zero for flat bodies
  double curvature = 0;  // calc_curvature() on the tests
  la::Matrix values;     // (rows of this rank, R); empty unless requested
  std::int64_t solves = 0;
  double error = 0;  // energy error as measured by find_rank()
  Samples tests;     // test motions of single modes and of all modes, with their energies:
  la::Vector full;   // (tests) quartic energy of all fields [J]
  la::Vector cubic;  // (tests) <eps(q), s(q)> [J]
};

/// Root of the largest fraction of a motion's linear energy that lies in the fields: 0 for a flat body, 1 if all of it does. Uses only the
/// directions of the fields that hold all but `error` of the energy of the motions; in the others mesh asymmetry dominates. linear: (R, N);
/// eta: (R, motions).
double calc_curvature(const la::Matrix& linear, const la::Matrix& eta, const std::vector<double>& omega, double error);
/// Bodies are curved above it. Mesh asymmetry gives flat ones up to half of it; its effect on pitch is quadratic.
inline constexpr double kCurved = 0.02;

/// Largest energy error of motions, relative to each one's energy or a hundredth of the mean, if larger; and the rms error of the cubic
/// part.
double calc_error(const la::Vector& energy, const la::Vector& cubic, const la::Vector& full, const la::Vector& full_cubic);

/// Smallest number of leading fields whose error on the tests is at most `error`; sets `error` to theirs: see calc_error().
std::ptrdiff_t find_rank(const StressFields& fields, double& error);

/// G_(ij)(kl) = <E_ij, C E_kl> - f_ij^T K^-1 f_kl, as <s_ij, s_kl> with s_ij = E_ij - eps(theta_ij): positive semidefinite up to rounding.
/// work (N, pairs): <eps(phi), s_ij>.
struct Gram {
  la::Matrix values;  // (pairs, pairs)
  la::Matrix work;
  Nodal theta;  // (local nodes, 3, pairs)
};
Gram calc_gram(const CoupledBody& body);

/// Condenses all pairs: one solve each. error: maximum, of the energy. Collective.
StressFields calc_fields_of_pairs(const CoupledBody& body, double error, bool wants_values);

/// Condenses random motions until unused ones are spanned (randomised range finder): about R solves. Collective.
StressFields calc_fields_of_samples(const CoupledBody& body, double error);

}  // namespace carillon::coupling

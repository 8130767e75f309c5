// The quartic energy of a body's coupled modes, all other elastic motion statically condensed: what couples them in large motion.
#pragma once

#include <petscmat.h>

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/comm/communicator.hpp"
#include "precompute/fem/materials.hpp"
#include "runtime/bank/quartic_energy.hpp"

namespace carillon::coupling {

inline constexpr int kMaxModes = 400;        // that a job may couple: 80,200 pairs
inline constexpr int kModesOfAllPairs = 40;  // up to so many every pair has a solve of its own; beyond, motions are sampled

struct CondenseOptions {
  bool is_stretch = false;                  // the mean stretch alone, in three rows at most: a pitch that glides, at nearly no cost
  int modes = 50;                           // at most
  double below_hz = 3000;                   // of the coupled modes
  double energy_error = 1e-2;               // of the stored energy, relative, on motions that it was not made from
  std::vector<std::int32_t> eligible = {};  // numbers of the modes that may be coupled, ascending; empty: all
  double thickness_m = 0;                   // of the body, for reports
  /// Called on every rank before each block of solves with a line and the share that is done; may throw on all ranks alike.
  std::function<void(const std::string&, double)> report = {};
};

/// A solved body. Borrows all; K and M as fem::assemble() makes them of `local`.
struct SolvedModes {
  const mesh::LocalMesh& local;
  const fem::Materials& materials;
  Mat stiffness = nullptr;
  Mat mass = nullptr;
  std::span<const double> lambda;  // (modes) ascending [rad²/s²]
  Mat shapes = nullptr;            // (3n, modes) dense, phi^T M phi = 1, not rounded
  std::int32_t components = 1;     // connected pieces of the body
};

struct Condensed {
  bank::QuarticEnergy energy;      // on rank 0; modes are numbers of `lambda`. Empty where no mode bends
  std::int64_t solves = 0;         // right-hand sides
  std::int64_t bending_count = 0;  // modes up to below_hz that bend or twist
  bool splits_pair = false;        // one mode fewer than asked for, so as not to part two of one frequency
  double top_hz = 0;
  double membrane_hz = 0;  // 0: no mode of the band stretches; membrane_ratio is then an upper bound, of the last mode
  double curvature = 0;    // see StressFields::curvature
};

/// Condenses: docs/equations.md E13. V(q) is the least energy of quadratic strains of the coupled modes that all other displacements leave:
/// 1/2 |E2(q) - eps(w)|² in the norm of C, with w orthogonal to the coupled modes. The same on any number of ranks to the rounding of the
/// factorisation (1e-9 of V); signs and order of rows may differ where fields have the same energy. Collective. Throws on every rank:
/// InputError when the body has several components, fewer modes than are asked for, or no mean stretch where that is wanted; SolveError,
/// SystemError.
Condensed condense_modes(const comm::Communicator& comm, const SolvedModes& solved, const CondenseOptions& options);

/// gamma of a mode alone, q'' + omega² q (1 + gamma (q peak / s)²) = 0, for lengths s: 2 sum over r of A_r,ii² s² / (lambda peak²).
/// peak [kg^-1/2]: its largest displacement at q = 1. self_coupling: bank::calc_self_coupling().
double calc_hardening(double self_coupling, double lambda, double peak, double length_m);

}  // namespace carillon::coupling

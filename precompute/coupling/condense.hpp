// Quartic energy of coupled modes, with all other elastic motion statically condensed.
#pragma once

#include <petscmat.h>

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/fem/materials.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "runtime/bank/quartic_energy.hpp"

namespace carillon::coupling {

inline constexpr int kMaxModes = 400;  // maximum per job: 80,200 pairs

struct CondenseOptions {
  bool is_stretch = false;                  // mean stretch only, at most three rows: pitch glide at negligible cost
  int modes = 50;                           // at most
  double below_hz = 3000;                   // of the coupled modes
  double energy_error = 1e-2;               // maximum relative error of the stored energy on test motions
  std::vector<std::int32_t> eligible = {};  // modes that may be coupled, ascending; empty: all
  double thickness_m = 0;                   // for reports
  /// Called on every rank before each block of solves, with a line and the fraction done; may throw on all ranks alike.
  std::function<void(const std::string&, double)> report = {};
};

/// A solved body. Non-owning; K and M as fem::assemble() makes them of `local`.
struct SolvedModes {
  const mesh::LocalMesh& local;
  const fem::Materials& materials;
  Mat stiffness = nullptr;
  Mat mass = nullptr;
  std::span<const double> lambda;  // (modes) ascending [rad²/s²]
  Mat shapes = nullptr;            // (3n, modes) dense, phi^T M phi = 1, not rounded
  std::int32_t components = 1;     // connected parts of the body
};

struct Condensed {
  bank::QuarticEnergy energy;      // on rank 0; mode numbers index `lambda`. Empty if no mode bends
  std::int64_t solves = 0;         // right-hand sides
  std::int64_t bending_count = 0;  // bending or twisting modes up to below_hz
  bool splits_pair = false;        // one mode fewer than requested, to keep degenerate modes together
  double top_hz = 0;
  double membrane_hz = 0;  // 0: no mode of the band stretches; membrane_ratio is then an upper bound, from the last mode
  double curvature = 0;    // see StressFields::curvature
};

/// Static condensation (docs/equations.md E13): V(q) is the minimum over all other displacements w, orthogonal to the coupled modes, of 1/2
/// |E2(q) - eps(w)|² in the norm of C, E2 the quadratic strain of the coupled modes. Independent of the number of ranks up to rounding of
/// the factorisation (1e-9 of V); signs and order of rows may differ for fields of equal energy. Collective. Throws on every rank:
/// InputError if the body has several components, fewer modes than requested, or no mean stretch where that is requested; SolveError,
/// SystemError.
Condensed condense_modes(const comm::Communicator& comm, const SolvedModes& solved, const CondenseOptions& options);

/// gamma of an isolated mode, q'' + omega² q (1 + gamma (q peak / s)²) = 0, for lengths s: 2 sum over r of A_r,ii² s² / (lambda peak²).
/// peak [kg^-1/2]: largest displacement at q = 1. self_coupling: bank::calc_self_coupling().
double calc_hardening(double self_coupling, double lambda, double peak, double length_m);

}  // namespace carillon::coupling

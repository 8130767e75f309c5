// Energy shares of modes by material, and modal decay rates.
#pragma once

#include <petscmat.h>

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/fem/assemble.hpp"

namespace carillon::fem {

/// Fractions of a mode's energy by material; each sums to 1.
struct EnergyShares {
  std::int32_t materials = 0;
  std::vector<double> elastic;  // (modes, materials) phi^T K_r phi / phi^T K phi
  std::vector<double> kinetic;  // (modes, materials) phi^T M_r phi / phi^T M phi
};

struct Decay {
  std::vector<double> decay_per_s;  // (modes) d
  EnergyShares shares;              // empty for a single material (not computed)
};

/// phi_j^T A phi_j of the first `modes` columns of `shapes`. Collective.
std::vector<double> calc_forms(const comm::Communicator& comm, Mat a, Mat shapes, std::int64_t modes);

/// Decay rates [1/s] at these eigenvalues, which may differ from those of the shapes behind `shares`: (modes). Pure.
std::vector<double> calc_decay_per_s(const Materials& materials, const EnergyShares& shares, std::span<const double> lambda);

/// Decay rate of every mode, d = c / 2. One material: c(lambda) of its law. Several: the sum over the materials of each law's damping on
/// its share of the mode's elastic and kinetic energy (material::Material::calc_damping_per_s), the diagonal of the modal damping matrix;
/// docs/equations.md, damping. `lambda` (modes) [rad^2/s^2]; `shapes` (3n, modes) dense, rows as in the system of `local`, null without
/// modes. Collective. Throws on every rank as assemble().
Decay calc_decay(const comm::Communicator& comm, const mesh::LocalMesh& local, const Materials& materials, job::Mass mass,
                 std::span<const double> lambda, Mat shapes);

}  // namespace carillon::fem

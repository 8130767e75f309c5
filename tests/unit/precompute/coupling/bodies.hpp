// Bodies with their modes, for the tests of condense_modes().
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "precompute/coupling/condense.hpp"
#include "precompute/eigen/solve_modes.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::tests {

/// A body with everything that condense_modes() references.
struct ModalBody {
  comm::Communicator comm;
  mesh::DistributedMesh pieces;
  fem::Materials materials;
  fem::System system;
  eigen::Modes modes;

  coupling::SolvedModes solved() const {
    return {pieces.local, materials, system.stiffness, system.mass, modes.lambda, modes.shapes, pieces.components};
  }
  double freq_hz(std::size_t mode) const { return std::sqrt(modes.lambda[mode]) / (2 * M_PI); }
  /// Largest displacement of a mode.
  double peak(int mode) const {
    const la::LocalColumns shapes(modes.shapes);
    double peak = 0;
    for (PetscInt row = 0; row < shapes.rows; row += 3) {
      const double* u = shapes.column(mode) + row;
      peak = std::max(peak, std::hypot(u[0], u[1], u[2]));
    }
    return comm.max(peak);
  }
};

inline material::Material make_solid(double young_pa, double poisson, double density) {
  return {.young_modulus_pa = young_pa, .poisson_ratio = poisson, .density_kg_m3 = density, .alpha1_s = 0, .alpha2_per_s = 0};
}

using IsFixed = std::function<bool(const Vec3&)>;

inline ModalBody solve_body(MPI_Comm comm, const mesh::TetMesh& mesh, const IsFixed& is_fixed, const material::Material& material,
                            int modes, double high_hz = 1e6) {
  std::vector<std::int32_t> fixed;
  for (std::size_t i = 0; is_fixed && i < mesh.nodes_m.size(); ++i)
    if (is_fixed(mesh.nodes_m[i])) fixed.push_back(static_cast<std::int32_t>(i));
  ModalBody body{comm, mesh::distribute(comm, mesh, fixed), material, {}, {}};
  body.system = fem::assemble(comm, body.pieces.local, body.materials, job::Mass::consistent);
  eigen::NodeLayout layout;
  layout.nodes_m.assign(body.pieces.local.nodes_m.begin(), body.pieces.local.nodes_m.begin() + body.pieces.local.free_nodes);
  layout.component.assign(body.pieces.local.component.begin(), body.pieces.local.component.begin() + body.pieces.local.free_nodes);
  layout.component_count = body.pieces.components;
  layout.fixed = body.pieces.fixed_m;
  eigen::Options options;
  options.low_hz = 1;
  options.high_hz = high_hz;
  options.max_modes = modes;
  body.modes = eigen::solve_modes({body.system.stiffness, body.system.mass, layout}, options);
  return body;
}

/// V of the modes of an energy, on every rank.
inline double calc_energy(const comm::Communicator& comm, const bank::QuarticEnergy& energy, const std::vector<double>& q) {
  return comm.broadcast([&] {
    std::vector<double> gradient(q.size());
    return bank::calc_energy_j(energy, q, gradient);
  });
}

/// gamma of mode i of the energy (mode `mode` of the body) per length s.
inline double calc_gamma(const ModalBody& body, const bank::QuarticEnergy& energy, int mode, double length_m) {
  const double self = body.comm.broadcast([&] {
    std::size_t i = 0;
    while (i < energy.modes.size() && energy.modes[i] != mode) ++i;
    return i < energy.modes.size() ? bank::calc_self_coupling(energy)[i] : 0.0;
  });
  return coupling::calc_hardening(self, body.modes.lambda[mode], body.peak(mode), length_m);
}

}  // namespace carillon::tests

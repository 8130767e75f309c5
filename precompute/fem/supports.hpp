// Modal reactions at the supports of a body.
#pragma once

#include <mpi.h>
#include <petscmat.h>

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/fem/materials.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"

namespace carillon::fem {

/// A connected patch of fixed nodes of one entry of the job's "fixed".
struct Support {
  std::int32_t entry = 0;    // index into the job's "fixed"
  Vec3 centre_m{};           // of its area, or of its nodes if they span none
  Vec3 normal{};             // unit, out of the body; 0 if the nodes span no area
  double area_m2 = 0.0;      // of surface faces whose corners are all fixed by the entry
  double thickness_m = 0.0;  // sqrt(12) times the smaller of the area's radii of gyration: the short side of a rectangle
};

/// The same on every rank. S supports, m modes; phi is mass-normalised, so reactions are per unit modal amplitude.
struct Supports {
  std::vector<Support> list;     // by entry, then by the lowest node of the mesh
  std::vector<double> reaction;  // (m, S, 6) [N / (m kg^1/2)], [N m / (m kg^1/2)]: force on the body at the patch, couple about its centre
  std::vector<double> energy;    // (m, S) fraction of the strain energy in elements that touch the patch or have their centre within one
                                 // thickness of it
};

/// Calculates the reactions of all modes: (K phi - lambda M phi) at the fixed rows, summed over each patch; docs/equations.md, supports.
/// Summed over all patches, force and couple are -lambda times the integrals of rho phi and rho x cross phi, up to the residual of the
/// modes. `shapes` as in calc_decay(), null without modes. Empty if LocalMesh::fixed_by is. Collective. Throws on every rank.
Supports calc_supports(const comm::Communicator& comm, const mesh::LocalMesh& local, const Materials& materials, job::Mass mass,
                       std::span<const double> lambda, Mat shapes);

}  // namespace carillon::fem

// Static response of a body to loads, orthogonal to the kept modes.
#pragma once

#include <petscmat.h>

#include <memory>
#include <vector>

#include "precompute/comm/halo_exchange.hpp"
#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/la/block_kernels.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"

namespace carillon::coupling {

/// Displacements on this rank's nodes: (local nodes, 3, width), zero at fixed nodes.
using Nodal = std::vector<double>;

/// Halo of the free nodes by rows, as indices of local nodes. Collective.
comm::HaloExchange make_halo(const comm::Communicator& comm, const mesh::LocalMesh& local);

/// Scatters columns of own rows to the nodes, halo included. Collective.
Nodal spread(const comm::Communicator& comm, comm::HaloExchange& halo, const mesh::LocalMesh& local, const la::Columns& columns);

/// theta with K theta = f, M-orthogonal to the kept modes. For a body with rigid modes, f must do no work on them (true for loads from
/// element stresses); the rigid part of theta is arbitrary. All members are collective.
class StaticAnswer {
 public:
  /// K, M: as fem::assemble() makes them of `local`; they and `local` must outlive this. kept: columns of the own rows, M-orthonormal.
  /// lambda: a low elastic eigenvalue; K is shifted by 1e-5 of it, which changes theta by less than 1e-5. Throws SolveError if the
  /// factorisation fails, SystemError when out of memory.
  StaticAnswer(const comm::Communicator& comm, const mesh::LocalMesh& local, Mat stiffness, Mat mass, const la::Columns& kept,
               double lambda);

  /// Scatters columns of own rows to the nodes, halo included.
  Nodal spread(const la::Columns& columns) { return coupling::spread(comm_, halo_, *local_, columns); }
  /// loads: (local nodes, 3, width), this rank's contribution at every node; overwritten by theta, halo included. Returns (kept, width):
  /// work of the loads on the kept modes.
  la::Matrix solve(Nodal& loads, int width);

 private:
  comm::Communicator comm_;
  const mesh::LocalMesh* local_;
  comm::HaloExchange halo_;
  std::unique_ptr<eigen::ShiftedFactor> factor_;
  std::ptrdiff_t rows_ = 0;  // own
  int kept_count_ = 0;
  std::vector<double> kept_, images_;  // (rows, kept): phi and M phi
};

}  // namespace carillon::coupling

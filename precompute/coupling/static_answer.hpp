// The static answer of a body to loads, without the modes that are kept.
#pragma once

#include <petscmat.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/comm/halo_exchange.hpp"
#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/la/block_kernels.hpp"

namespace carillon::coupling {

/// Values of the mesh's displacements on this rank: (local nodes, 3, width), zero at fixed nodes.
using Nodal = std::vector<double>;

/// The halo of the free nodes by their rows, as places among the local nodes. Collective.
comm::HaloExchange make_halo(const comm::Communicator& comm, const mesh::LocalMesh& local);

/// Columns of own rows on the nodes, those of the halo too. Collective.
Nodal spread(const comm::Communicator& comm, comm::HaloExchange& halo, const mesh::LocalMesh& local, const la::Columns& columns);

/// theta with K theta = f on what is M-orthogonal to the kept modes. Of a body that can move without strain, f must do no work on such a
/// motion (loads of stresses in the elements do none); what theta has of it is arbitrary. All members are collective.
class StaticAnswer {
 public:
  /// K, M: as fem::assemble() makes them of `local`; they and `local` must outlive it. kept: columns of the own rows, M-orthonormal.
  /// lambda: eigenvalue of a slow elastic mode; K is factorised 1e-5 of it below zero, which changes theta by less than that.
  /// Throws SolveError when K cannot be factorised, SystemError when memory runs out.
  StaticAnswer(const comm::Communicator& comm, const mesh::LocalMesh& local, Mat stiffness, Mat mass, const la::Columns& kept,
               double lambda);

  /// Columns of own rows on the nodes, those of the halo too.
  Nodal spread(const la::Columns& columns) { return coupling::spread(comm_, halo_, *local_, columns); }
  /// loads: (local nodes, 3, width), this rank's part at every node. They become theta, at halo nodes too. Returns (kept, width): the work
  /// of the loads on the kept modes.
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

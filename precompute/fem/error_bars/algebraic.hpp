// Rigorous bounds on the distance of computed eigenvalues from those of K phi = lambda M phi.
#pragma once

#include <mpi.h>
#include <petscmat.h>

#include <vector>

#include "precompute/fem/error_bars/error_bars.hpp"

namespace carillon::error_bars {

/// Constants with least D <= M <= greatest D, D = diag(M), in the sense of quadratic forms; the same on every rank.
struct MassBounds {
  double min = 1.0;
  double max = 1.0;
};

/// From the elements: M = sum M_e and D = sum D_e, so the extreme eigenvalues of all D_e^-1 M_e bound those of D^-1 M. Collective.
MassBounds find_mass_bounds(const comm::Communicator& comm, const mesh::LocalMesh& local, job::Mass mass_kind);

/// The bound per mode in cents; see ErrorBars::algebraic_cents. Collective.
std::vector<double> calc_algebraic_cents(const comm::Communicator& comm, Mat stiffness, Mat mass, const MassBounds& bounds,
                                         const Solution& solution);

}  // namespace carillon::error_bars

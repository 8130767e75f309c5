// Small bodies with difficult spectra, solved in all ways, and the invariants of the solutions.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <string>
#include <vector>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/fem/error_bars/error_bars.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::hard {

struct Body {
  mesh::TetMesh mesh;
  std::vector<material::Material> materials;  // by region of the mesh
};

/// A material without damping.
material::Material make_solid(double young_modulus_pa, double poisson_ratio, double density_kg_m3);

/// Both in one mesh, without contact: the materials of `b` follow those of `a`.
Body join(const Body& a, const Body& b);

/// All nodes, mid-side nodes too, go where `place` says.
template <class Place>
mesh::TetMesh move_nodes(mesh::TetMesh mesh, Place&& place) {
  for (Vec3& x : mesh.nodes_m) x = place(x);
  return mesh;
}

struct Answer {
  mesh::DistributedMesh pieces;
  fem::System system;
  eigen::Modes modes;
  std::vector<double> freq_hz;
};
Answer solve(MPI_Comm comm, const Body& body, const eigen::Options& options);

/// Of the answer's modes, on the communicator they were solved on. Collective.
error_bars::ErrorBars calc_bars(MPI_Comm comm, const Body& body, const Answer& answer, const eigen::Options& options);

/// Eigenvalues of K and M below that frequency by the pivots of Eigen's L D L^T, on this rank alone.
std::int64_t count_below(const fem::System& alone, double freq_hz);

/// The largest |a_i / b_i - 1|; infinity where they are not as many.
double find_largest_difference(const std::vector<double>& a, const std::vector<double>& b);

/// Solves the body by block Lanczos, Krylov-Schur and, while that is quick, densely, on all ranks and on one, and holds under `id`:
///   count       modes that the inertia of Eigen's L D L^T counts in the band, against those found: equal
///   methods     frequencies of the other methods, relative, to 1e-9
///   ranks       frequencies of all ranks against one rank, relative, to 1e-9
///   subspaces   sine of the angle between the modes of all ranks and of one, group by group, to 1e-6
/// Gives the answer of block Lanczos on all ranks. Collective on PETSC_COMM_WORLD.
Answer hold_every_way(const std::string& id, const std::string& part, const Body& body, const eigen::Options& options);

/// Holds the computed modes to true frequencies [Hz], ascending: |error| / bar of the worst mode, at most 1. Collective.
void hold_bars(const std::string& id, const std::string& part, const Body& body, const Answer& answer, const eigen::Options& options,
               const std::vector<double>& true_hz);

/// Holds the relative difference of modes of one group to `bound`. sizes: numbers of degenerate modes, from mode `first` on.
void hold_groups(const std::string& id, const std::string& part, const std::vector<double>& freq_hz, std::size_t first,
                 const std::vector<int>& sizes, double bound);

inline eigen::Options make_band(double low_hz, double high_hz) {
  eigen::Options options;
  options.low_hz = low_hz;
  options.high_hz = high_hz;
  return options;
}

}  // namespace carillon::hard

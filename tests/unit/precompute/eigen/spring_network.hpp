// Point masses and springs as eigenproblems: bodies with known answers without finite elements.
#pragma once

#include <vector>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen::test {

struct Spring {
  int a = 0;
  int b = 0;
  double rate = 1;            // [N/m]
  bool is_isotropic = false;  // false: spring along the line a-b; true: the same stiffness in x, y and z (three scalar lattices)
};

struct Network {
  std::vector<Vec3> nodes;
  std::vector<double> mass_kg;
  std::vector<Spring> springs;
  std::vector<int> component;
  std::vector<int> fixed;  // fixed nodes
};

/// A network as distributed matrices, free nodes in order, split evenly over the ranks of `comm`.
struct System {
  petsc::MatHandle stiffness;
  petsc::MatHandle mass;
  Problem problem;
};
System make_system(const Network& network, MPI_Comm comm = PETSC_COMM_WORLD);

/// The same network with reordered nodes: node i becomes node place[i].
Network reorder(const Network& network, const std::vector<int>& place);

/// All eigenvalues by dsyev of LAPACK on M^-1/2 K M^-1/2, ascending; the same on every rank.
std::vector<double> calc_all_eigenvalues(const Network& network);

/// nx x ny x nz masses, axial springs along edges and face diagonals: a free elastic block. Slightly irregular, so that eigenvalues are
/// distinct.
Network make_block(int nx, int ny, int nz, Vec3 origin = {0, 0, 0}, double spacing = 1);
/// Both networks side by side, unconnected.
Network join(const Network& a, const Network& b);

double to_hz(double lambda);

/// Eigenvalues in a band, without zeros.
std::vector<double> pick(const std::vector<double>& all, double low_hz, double high_hz);
/// Fails the test unless the modes have exactly these eigenvalues, to 1e-9 relative.
void expect_eigenvalues(const Modes& modes, const std::vector<double>& expected);

}  // namespace carillon::eigen::test

namespace carillon::eigen {

// Common declarations of the tests with networks.
using petsc::check;
using test::expect_eigenvalues;
using test::make_block;
using test::Network;
using test::pick;
using test::to_hz;

}  // namespace carillon::eigen

// Accuracy of a set of modes, measured from K and M alone.
#pragma once

#include <petscmat.h>

#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/eigen/types.hpp"
#include "precompute/la/node_matrix.hpp"

namespace carillon::eigen {

/// K and M of a pencil, with their factors, for products with many columns.
struct Operators {
  explicit Operators(const la::Pencil& pencil);

  la::NodeMatrix stiffness;
  la::NodeMatrix mass;
  std::vector<double> stiffness_diagonal;  // (own rows)
  std::vector<double> mass_diagonal;       // (own rows)
  comm::Communicator comm;
};

struct ModeErrors {
  std::vector<double> residual;  // (modes) ||K phi - lambda M phi||_2 / (lambda ||M phi||_2)
  /// (modes) residual explained by rounding of K phi: kRoundOff epsilon ||diag(K) phi||_2 / (lambda ||M phi||_2)
  std::vector<double> floor;
  double orthonormality = 0;  // max |phi_i^T M phi_j - delta_ij|
};

/// Normalises each column to phi^T M phi = 1, sets lambda to the Rayleigh quotients phi^T K phi (error of second order), and measures
/// residuals and orthonormality. lambda: (modes); shapes: (3n, modes) dense. Collective.
ModeErrors normalise_and_measure(const Operators& operators, std::vector<double>& lambda, Mat shapes);

/// Sorts modes, shapes and errors by ascending lambda. Collective.
void sort_modes(std::vector<double>& lambda, Mat shapes, ModeErrors& errors);

/// Gram-Schmidt in the M inner product from the first column on: Phi <- Phi R^-1 with Phi^T M Phi = R^T R. Columns must ascend in lambda:
/// an error that is small relative to a high mode would be large relative to a low one, so low modes take no part of higher ones.
/// Collective. Throws SolveError if columns are linearly dependent.
void orthonormalise_shapes(const Operators& operators, Mat shapes);

/// Sets the sign of each column so that its entry of largest magnitude is positive; among entries equal to 1e-4, the node that comes first
/// by x, y, z decides, so results do not depend on the partition. Collective.
void orient_shapes(Mat shapes, const std::vector<Vec3>& nodes_m);

}  // namespace carillon::eigen

// Eigenvalues of -Laplace on a triangle mesh, zero along the rim, by high-order finite elements.
#pragma once

#include <vector>

#include "precompute/analytic/slabs.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::analytic {

/// Lagrange functions of one order on the unit triangle, at nodes that are Gauss-Lobatto points on each side (Isaac 2020, Recursive,
/// parameter-free, explicitly defined interpolation nodes for simplices): equispaced nodes would lose five digits at order eight.
class TriangleBasis {
 public:
  explicit TriangleBasis(int order);
  int size() const { return static_cast<int>(points_.size()); }
  int order() const { return order_; }
  const std::vector<Point2>& points() const { return points_; }
  /// Lattice indices of each point: barycentric numbers that add up to the order.
  const std::vector<std::array<int, 3>>& places() const { return places_; }
  /// Values at (r, s), r, s >= 0, r + s <= 1.
  la::Vector calc(double r, double s) const;
  /// Integrals over the unit triangle, (size, size): products of values; of derivatives (r r), (r s) and (s s).
  la::Matrix mass, stiffness_rr, stiffness_rs, stiffness_ss;

 private:
  /// Dubiner's (1991) orthonormal polynomials and their derivatives, columns: value, by r, by s.
  Eigen::Matrix<double, Eigen::Dynamic, 3> calc_polynomials(double r, double s) const;
  int order_;
  std::vector<Point2> points_;
  std::vector<std::array<int, 3>> places_;
  la::Matrix inverse_;  // of the Vandermonde matrix in orthonormal polynomials
};

/// Modes with unit integral of the square.
struct TriangleModes {
  std::vector<double> kappa;                        // (m) [1/m^2], ascending
  la::Matrix shapes;                                // (nodes, m)
  std::vector<std::vector<std::int32_t>> elements;  // (triangles)(basis size): nodes, in the order of the basis
  std::vector<double> residuals;                    // (m) relative
};

/// All eigenvalues up to `max_kappa`, by the solver of solids (eigen::solve_modes), counted by inertia. Not collective. Throws as that
/// does.
TriangleModes solve_triangles(const Net& net, const TriangleBasis& basis, double max_kappa);

}  // namespace carillon::analytic

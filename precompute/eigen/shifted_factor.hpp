// Factorisations of K - sigma M for the shift-invert iteration and the counts of eigenvalues.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "precompute/la/pencil.hpp"

namespace carillon::ldlt {
class MeshOrder;
}  // namespace carillon::ldlt

namespace carillon::eigen {

/// A direct solver for K - sigma M with a fixed pattern and changing sigma. All members except get_...() are collective and fail on all
/// ranks alike. K and M must outlive it.
class ShiftedFactor {
 public:
  virtual ~ShiftedFactor() = default;

  /// Factorises K - sigma M. False if a pivot vanished: sigma is an eigenvalue, use another. Throws SolveError for other breakdowns,
  /// SystemError if memory runs out.
  bool factorise(double sigma) {
    shift_ = sigma;
    return try_factorise(sigma);
  }
  /// Sigma of the last factorise.
  double get_shift() const { return shift_; }
  /// X <- (K - sigma M)^-1 B: rows of this rank, column-major, same stride. b and x are equal or do not overlap.
  virtual void solve(const double* b, double* x, std::ptrdiff_t stride, int columns) = 0;
  /// Number of eigenvalues below the sigma of the last factorise (Sylvester's law of inertia).
  virtual std::int64_t get_negative_pivots() const = 0;
  /// Relative residual of a solve with the last factorisation; 0 if not measured.
  virtual double get_backward_error() const = 0;
  /// Peak memory of a factorisation on this rank [byte], from the analysis; 0 if unknown.
  virtual std::int64_t get_peak_bytes() const = 0;

  virtual std::string get_solver() const = 0;
  virtual std::string get_ordering() const = 0;
  virtual std::int64_t get_entries() const = 0;  // of the factor; 0 if unknown
  virtual double get_flops() const = 0;          // of a factorisation; 0 if unknown

 private:
  virtual bool try_factorise(double sigma) = 0;

  double shift_ = 0;
};

/// carillon::ldlt: parallel supernodal L D L^T for many right-hand sides. factorise is also false if its measured backward error is too
/// large. order: of the mesh, as in ldlt::Factor.
std::unique_ptr<ShiftedFactor> make_ldlt_factor(const la::Pencil& pencil, const ldlt::MeshOrder* order = nullptr);

/// MUMPS: L D L^T with pivoting across fronts. elimination_position: on rank 0, position of each node in the elimination order; empty:
/// MUMPS orders.
std::unique_ptr<ShiftedFactor> make_mumps_factor(const la::Pencil& pencil, const std::vector<std::int32_t>& elimination_position);

}  // namespace carillon::eigen

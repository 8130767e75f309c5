// Factorisations of K - sigma M that the shift-invert iteration and the counts of eigenvalues need.
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

/// A direct solver for K - sigma M with a fixed pattern and changing sigma. All members but the get_ ones are collective and fail on all
/// ranks alike. K and M must outlive it.
class ShiftedFactor {
 public:
  virtual ~ShiftedFactor() = default;

  /// Factorises K - sigma M. False if a pivot vanished: sigma hits an eigenvalue, take another. Throws SolveError when the factorisation
  /// breaks down otherwise, SystemError when memory runs out.
  virtual bool factorise(double sigma) = 0;
  /// X <- (K - sigma M)^-1 B: this rank's rows, column-major, both with the same stride. b may be x, and shares no part of it else.
  virtual void solve(const double* b, double* x, std::ptrdiff_t stride, int columns) = 0;
  /// Number of eigenvalues below the sigma of the last factorise (Sylvester's law of inertia).
  virtual std::int64_t get_negative_pivots() const = 0;
  /// Relative residual of a solve with the last factorisation; 0 if it is not measured.
  virtual double get_backward_error() const = 0;
  /// Memory a factorisation will take at its worst moment on this rank [byte], known from the analysis; 0 if unknown.
  virtual std::int64_t get_peak_bytes() const = 0;

  virtual std::string get_solver() const = 0;
  virtual std::string get_ordering() const = 0;
  virtual std::int64_t get_entries() const = 0;  // of the factor; 0 if unknown
  virtual double get_flops() const = 0;          // of a factorisation; 0 if unknown
};

/// carillon::ldlt: supernodal L D L^T over the ranks, made for many right-hand sides. factorise is also false when its measured backward
/// error is too large. order: of the mesh, as ldlt::Factor takes it.
std::unique_ptr<ShiftedFactor> make_ldlt_factor(const la::Pencil& pencil, const ldlt::MeshOrder* order = nullptr);

/// MUMPS: L D L^T with pivoting across fronts. elimination_position: on rank 0, per node the place in the elimination order; empty: MUMPS
/// orders.
std::unique_ptr<ShiftedFactor> make_mumps_factor(const la::Pencil& pencil, const std::vector<std::int32_t>& elimination_position);

/// CHOLMOD: supernodal L L^T on one rank; sigma must be negative, so it cannot count.
std::unique_ptr<ShiftedFactor> make_cholmod_factor(const la::Pencil& pencil, const std::vector<std::int32_t>& elimination_position);

}  // namespace carillon::eigen

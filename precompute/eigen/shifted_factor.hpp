// Factorisations of K - sigma M that the shift-invert iteration and the counts of eigenvalues need.
#pragma once

#include <petscmat.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace carillon::eigen {

/// A direct solver for K - sigma M with a fixed pattern and changing sigma. All members are collective and fail on all ranks alike.
/// K and M must outlive it.
class ShiftedFactor {
 public:
  virtual ~ShiftedFactor() = default;

  /// Factorises K - sigma M. False if a pivot vanished: sigma hits an eigenvalue, take another. Throws SolveError when the factorisation
  /// breaks down otherwise, SystemError when memory runs out.
  virtual bool factorise(double sigma) = 0;
  /// x = (K - sigma M)^-1 b.
  virtual void solve(Vec b, Vec x) = 0;

  virtual std::string get_solver() const = 0;
  virtual std::string get_ordering() const = 0;
  virtual std::int64_t get_entries() const = 0;  // of the factor; 0 if unknown
  virtual double get_flops() const = 0;          // of a factorisation; 0 if unknown
};

/// L D L^T with pivoting for any sigma. It also counts: the negative pivots of the last factorise are the eigenvalues below sigma.
class MumpsFactor final : public ShiftedFactor {
 public:
  /// Analyses the union of both patterns. elimination_position: on rank 0, per node the place in the elimination order; empty: MUMPS
  /// orders.
  MumpsFactor(Mat stiffness, Mat mass, const std::vector<std::int32_t>& elimination_position);
  ~MumpsFactor() override;

  bool factorise(double sigma) override;
  void solve(Vec b, Vec x) override;
  /// Number of eigenvalues below the sigma of the last factorise (Sylvester's law of inertia).
  std::int64_t get_negative_pivots() const;

  std::string get_solver() const override;
  std::string get_ordering() const override;
  std::int64_t get_entries() const override;
  double get_flops() const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Supernodal L L^T on one rank, faster than MUMPS in single solves; sigma must be negative.
std::unique_ptr<ShiftedFactor> make_cholmod_factor(Mat stiffness, Mat mass, const std::vector<std::int32_t>& elimination_position);

}  // namespace carillon::eigen

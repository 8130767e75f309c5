// Sparse L D L^T of K - sigma M over the ranks, made for many shifts and many right-hand sides.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "precompute/la/pencil.hpp"

namespace carillon::ldlt {

class MeshOrder;

/// What a factorisation will cost, known before any number is computed; the same on every rank.
struct Analysis {
  struct Rank {
    std::int64_t entries = 0;     // of L and D kept on the rank, the zeros that amalgamation stores included
    double flops = 0;             // of its part of a factorisation
    std::int64_t peak_bytes = 0;  // factor with the update matrices at their worst moment, or with the workspace of a solve
  };
  std::vector<Rank> ranks;
  std::int64_t entries = 0;  // sums over the ranks
  double flops = 0;
  std::int64_t peak_bytes = 0;
  std::int64_t largest_peak_bytes = 0;  // of one rank
  std::int64_t supernodes = 0;
  std::int64_t shared_fronts = 0;  // of several ranks
  std::int64_t shared_nodes = 0;   // their pivots
};

/// L D L^T of K - sigma M with a fixed pattern and changing sigma, by the multifrontal method (docs/decisions/factorisation.md).
///
/// K and M: (3n, 3n) real AIJ, symmetric with both triangles stored, rows in blocks of three per node, whole nodes per rank; a rank may
/// have none. M is diagonal, in K's pattern, or any other. Patterns are taken at construction, values at the first factorise(); from there
/// on they must stay, and outlive the factor. Every member but the get_ ones is collective and fails on all ranks alike.
class Factor {
 public:
  /// Orders the nodes and plans fronts, memory and messages; computes no number. Symmetry is assumed and not checked. order: of the mesh
  /// that K and M are of, with the rows' numbers; null: they are ordered here. Throws InputError when the rows are not whole nodes, the
  /// matrices not AIJ or the order not theirs, SystemError when memory runs out.
  explicit Factor(const la::Pencil& pencil, const MeshOrder* order = nullptr);
  ~Factor();
  Factor(Factor&&) noexcept;
  Factor& operator=(Factor&&) noexcept;

  const Analysis& get_analysis() const;

  /// Factorises K - sigma M. False if it cannot be trusted: a pivot vanished (sigma hits an eigenvalue) or the measured backward error of
  /// the factorisation alone is above 1e-10; move sigma a little, or take another solver. Throws SystemError, naming the need in GB, when
  /// memory runs out.
  [[nodiscard]] bool factorise(double sigma);

  /// The number of eigenvalues below the sigma of the last factorise (Sylvester's law of inertia).
  std::int64_t get_negative_pivots() const;
  /// max|b - A x| / (||A||_inf max|x| + max|b|) of a random solve with the last factorisation, refined where solves are.
  /// Of one that cannot be trusted, without refinement.
  double get_backward_error() const;
  /// Largest magnitude in L: how far pivoting inside the blocks let the numbers grow.
  double get_growth() const;

  /// X <- (K - sigma M)^-1 B. b, x: this rank's rows, column-major (stride >= own rows), any number of columns; fastest in multiples of 16.
  /// b may be x; otherwise they must not overlap.
  /// With one step of iterative refinement, at twice the price, where the backward error of the factorisation is above 3e-13.
  void solve(const double* b, double* x, int stride, int columns);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace carillon::ldlt

// Parallel sparse L D L^T of K - sigma M for many shifts and many right-hand sides.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "precompute/la/pencil.hpp"

namespace carillon::ldlt {

class MeshOrder;

/// Predicted cost of a factorisation, from the symbolic analysis; the same on every rank.
struct Analysis {
  struct Rank {
    std::int64_t entries = 0;     // of L and D kept on the rank, including explicit zeros from amalgamation
    double flops = 0;             // of its share of a factorisation
    std::int64_t peak_bytes = 0;  // peak of the factor with its contribution blocks, or with the workspace of a solve
  };
  std::vector<Rank> ranks;
  std::int64_t entries = 0;  // sums over the ranks
  double flops = 0;
  std::int64_t peak_bytes = 0;
  std::int64_t largest_peak_bytes = 0;  // of one rank
  std::int64_t supernodes = 0;
  std::int64_t shared_fronts = 0;  // fronts on several ranks
  std::int64_t shared_nodes = 0;   // pivots of those
};

/// L D L^T of K - sigma M with a fixed pattern and changing sigma, by the multifrontal method (docs/decisions/factorisation.md). K and M:
/// (3n, 3n) real AIJ, symmetric with both triangles stored, rows in blocks of three per node, whole nodes per rank; a rank may have none. M
/// is diagonal, in the pattern of K, or any other. Patterns are read at construction, values at the first factorise(); from then on both
/// must not change and must outlive the factor. Every member except get_...() is collective and fails on all ranks alike.
class Factor {
 public:
  /// Orders the nodes and plans fronts, memory and messages; computes no values. Symmetry is assumed, not checked. order: elimination order
  /// of the mesh of K and M, with row numbers; null: nodes are ordered here. Throws InputError if rows are not whole nodes, the matrices
  /// are not AIJ, or the order does not fit; SystemError if memory runs out.
  explicit Factor(const la::Pencil& pencil, const MeshOrder* order = nullptr);
  ~Factor();
  Factor(Factor&&) noexcept;
  Factor& operator=(Factor&&) noexcept;

  const Analysis& get_analysis() const;

  /// Factorises K - sigma M. False if it is unreliable: a pivot vanished (sigma is an eigenvalue) or the measured backward error is above
  /// 1e-10; move sigma slightly, or use another solver. Throws SystemError with the requirement in GB if memory runs out.
  [[nodiscard]] bool factorise(double sigma);

  /// Number of eigenvalues below the sigma of the last factorise (Sylvester's law of inertia).
  std::int64_t get_negative_pivots() const;
  /// max|b - A x| / (||A||_inf max|x| + max|b|) of a random solve with the last factorisation, refined if solves are; for a rejected
  /// factorisation, without refinement.
  double get_backward_error() const;
  /// Largest magnitude in L: element growth due to pivoting within blocks.
  double get_growth() const;

  /// X <- (K - sigma M)^-1 B. b, x: rows of this rank, column-major (stride >= own rows), any number of columns; fastest in multiples of
  /// 16. b may be x; otherwise they must not overlap. If the backward error of the factorisation is above 3e-13, one step of iterative
  /// refinement doubles the cost.
  void solve(const double* b, double* x, int stride, int columns);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace carillon::ldlt

// One shift-invert Krylov run through SLEPc's eigensolver object.
#pragma once

#include <slepceps.h>

#include <functional>
#include <vector>

#include "precompute/eigen/lanczos_checkpoint.hpp"
#include "precompute/eigen/locked_modes.hpp"
#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/eigen/types.hpp"
#include "precompute/la/node_matrix.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// Modes found so far, in the order they came: M-orthonormal columns of one dense matrix with room for more.
class FoundModes {
 public:
  /// Drops all modes and makes room for `capacity` with K's rows; `rigid` are found beforehand. Collective.
  void reset(Mat stiffness, PetscInt capacity, const std::vector<petsc::VecHandle>& rigid);
  /// Adds a pair whose shape `write` puts into the vector it is given; nothing where that returns false. Collective.
  void add(double eigenvalue, const std::function<bool(Vec shape)>& write);
  /// The rigid modes, and those found from the first above `low` on: all modes above it, others perhaps. They stay this object's, and where
  /// they are until a mode is added. Local.
  LockedModes find_above(double low) const;
  /// The columns by the order given, and nothing else; this object is empty afterwards. Collective.
  petsc::MatHandle take(const std::vector<std::size_t>& order);
  /// Makes room for `count` modes in all. Collective.
  void make_room(PetscInt count);
  /// The columns; those beyond lambda.size() mean nothing.
  Mat get_columns() const { return columns_; }

  std::vector<double> lambda;

 private:
  petsc::MatHandle make_columns(PetscInt count) const;
  Mat stiffness_ = nullptr;
  petsc::MatHandle columns_;
  petsc::MatHandle rigid_;
  int rigid_count_ = 0;
  PetscInt capacity_ = 0;
};

struct KrylovRequest {
  la::Pencil pencil;
  const la::NodeMatrix* mass_blocks = nullptr;  // M of the pencil, for many columns at a time
  ShiftedFactor* factor = nullptr;              // already factorised at sigma
  double sigma = 0;
  double low = 0;  // the interval whose eigenvalues are sought,
  double high = 0;
  PetscInt count = 0;                          // how many it holds without the locked ones,
  bool is_count_known = true;                  // as is known, or guessed,
  PetscInt nearest = 0;                        // and so many nearest sigma cover them (for what can only seek the nearest)
  Method method = Method::kAutomatic;          // unless SLEPc's options say otherwise
  double tolerance = 1e-10;                    // of the Ritz residual, relative to theta = 1 / (lambda - sigma) and to lambda
  double locked_above = 0;                     // modes found above this lambda, and the rigid ones: the run stays M-orthogonal to them
  const std::vector<Vec3>* nodes_m = nullptr;  // what the starting block is made of
  int round = 0;                               // starting blocks of different rounds differ
  /// Pairs converged and right-hand sides solved in this run so far; may be empty.
  std::function<void(std::int64_t converged, std::int64_t solves)> progress;
  LanczosCheckpoint* checkpoint = nullptr;  // of the block method; may be null
};

struct KrylovStatistics {
  std::int64_t solves = 0;
  double solve_seconds = 0;
  double solved_to = 0;  // From sigma up to here no eigenvalue is missing, as far as the run shows; at most the interval's end.
};

/// Columns of the block method's basis, residuals included, for `wanted` eigenvalues with `locked` columns deflated: twice the modes and
/// eight blocks are what runs from the bottom of a spectrum take; it is more with neighbours on both sides, or after a guess.
std::int64_t calc_basis_size(std::int64_t wanted, std::int64_t locked, bool is_count_known);

/// Adds the eigenpairs of K x = lambda M x that it finds in the interval to `found`; fewer than there are when some did not converge, or
/// copies of repeated eigenvalues stayed hidden. Collective.
KrylovStatistics run_krylov(const KrylovRequest& request, FoundModes& found);

}  // namespace carillon::eigen

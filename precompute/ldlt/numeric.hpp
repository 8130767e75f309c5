// Values of a factorisation.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "precompute/ldlt/buffer.hpp"
#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/plan.hpp"

namespace carillon::ldlt {

/// Pivot statistics of a factorisation.
struct Outcome {
  std::int64_t negative = 0;                                  // eigenvalues of D below zero
  double smallest = std::numeric_limits<double>::infinity();  // smallest magnitude of a pivot
  double growth = 0;                                          // largest magnitude in L21
  bool is_complete = true;                                    // no pivot was exactly zero

  /// triangle <- L^-1 of a diagonal block (columns kMaxBlock apart, both triangles). If a pivot vanishes, sets triangle and pivots to zero,
  /// so that later values stay finite.
  void eliminate(const FactorKernels& kernels, double* block, int n, BlockPivots& pivots, double* triangle);
};

/// Offsets of a panel of a shared front in this rank's numbers; -1: not on this rank.
struct SharedPanel {
  std::int64_t triangle = -1;  // L11^-1, with the diagonal tile
  std::int64_t tiles = -1;     // L21 of this rank's rows
  std::int32_t pivots = -1;    // D and order, with the diagonal tile
};

/// L D L^T of this rank's fronts. A front is a sequence of panels; a panel is L11^-1 followed by L21, both in tiles (kernels.hpp).
struct Numbers {
  Buffer panels;
  std::vector<std::int64_t> front_offsets;       // begin of each front's panels
  std::vector<std::vector<SharedPanel>> shared;  // (shared fronts) of (pivot tiles)
  std::vector<std::int64_t> shared_columns;      // begin of the pivot columns of each shared front during its factorisation
  // At the pivots of this rank, own fronts first:
  std::vector<double> d_diagonal;   // D^-1: diagonal ...
  std::vector<double> d_off;        // ... and off-diagonal, between a row and the next
  std::vector<std::uint8_t> order;  // pivot order in each panel: BlockPivots::order
  Outcome outcome;                  // of this rank during a factorisation, then of all ranks
  int generation = 0;               // number of factorisations so far

  /// Null if this rank has no part of the panel.
  const double* find_tiles(const SharedPanel& panel) const { return panel.tiles < 0 ? nullptr : panels.data() + panel.tiles; }
};

/// Allocates the panels. Throws std::bad_alloc.
Numbers make_numbers(const Plan& plan);

/// Right-hand sides in elimination order: blocks of 8 or 16 columns, each row-major.
struct Workspace {
  std::vector<double*> blocks;  // one per kBlockColumns columns: rows of all slots
  std::vector<Buffer> buffers;  // memory of blocks that do not fit behind the panels
  Buffer columns;               // of the panels of a shared front: this rank's solutions or sums
};

/// x <- A^-1 b for at most kSolveColumns columns, `stride` apart; b may be x. Collective.
void solve_columns(const Plan& plan, const Numbers& numbers, Workspace& workspace, const double* b, double* x, int stride, int columns);
/// Uses the room behind the panels if sufficient, so numbers must outlive it. Throws std::bad_alloc.
Workspace make_workspace(const Plan& plan, const Numbers& numbers);

/// Computes L D L^T of K - sigma M. Also uses the memory of the workspace, which is made again afterwards. Collective. Throws SystemError
/// on all ranks if memory runs out.
void factorise_fronts(const Plan& plan, const la::Pencil& pencil, double sigma, Numbers& numbers, Workspace& workspace);

}  // namespace carillon::ldlt

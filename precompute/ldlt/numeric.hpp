// The numbers of a factorisation, and what computes and uses them.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "precompute/ldlt/buffer.hpp"
#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/plan.hpp"

namespace carillon::ldlt {

/// What the pivots of a factorisation were like.
struct Outcome {
  std::int64_t negative = 0;                                  // eigenvalues of D below zero
  double smallest = std::numeric_limits<double>::infinity();  // least magnitude of a pivot
  double growth = 0;                                          // largest magnitude in L21
  bool is_complete = true;                                    // no pivot vanished exactly

  /// triangle <- L^-1 of a diagonal block (columns kMaxBlock apart, both triangles); zero with zero pivots when one vanishes, so that what
  /// follows stays finite.
  void eliminate(const Kernels& kernels, double* block, int n, BlockPivots& pivots, double* triangle);
};

/// Where a panel of a shared front is among this rank's numbers; -1: it has none.
struct SharedPanel {
  std::int64_t triangle = -1;  // L11^-1, with the diagonal tile
  std::int64_t tiles = -1;     // L21 of its rows below
  std::int32_t pivots = -1;    // D and order, with the diagonal tile
};

/// L D L^T of this rank's fronts. Each front is a row of panels; each panel is L11^-1 and then L21, both in tiles (kernels.hpp).
struct Numbers {
  Buffer panels;
  std::vector<std::int64_t> front_offsets;       // where each front's panels begin
  std::vector<std::vector<SharedPanel>> shared;  // (shared fronts) of (pivot tiles)
  std::vector<std::int64_t> shared_columns;      // where the pivot columns of each shared front begin while it is in work
  // At this rank's pivots, first those of its own fronts:
  std::vector<double> d_diagonal;   // the inverse of D: diagonal ...
  std::vector<double> d_off;        // ... and between a row and the next
  std::vector<std::uint8_t> order;  // of the pivots in their panels: BlockPivots::order
  Outcome outcome;                  // of this rank until a factorisation ends, then of all
  int generation = 0;               // how often it was factorised

  /// Null: this rank has none of it.
  const double* find_tiles(const SharedPanel& panel) const { return panel.tiles < 0 ? nullptr : panels.data() + panel.tiles; }
};

/// Room for the panels. Throws std::bad_alloc.
Numbers make_numbers(const Plan& plan);

/// Right-hand sides in order of elimination: blocks of 8 or 16 columns, in each a row of them per row of the matrix.
struct Workspace {
  std::vector<double*> blocks;  // one per kBlockColumns columns: rows of all slots
  std::vector<Buffer> buffers;  // of those that have no room after the panels
};

/// x <- A^-1 b for at most kSolveColumns columns, `stride` apart; b may be x. Collective.
void solve_columns(const Plan& plan, const Numbers& numbers, Workspace& workspace, const double* b, double* x, int stride, int columns);
/// Lies after the panels where there is room, so numbers must outlive it. Throws std::bad_alloc.
Workspace make_workspace(const Plan& plan, const Numbers& numbers);

/// Computes L D L^T of K - sigma M, in the memory of the workspace too, which is made again afterwards. Collective. Throws SystemError on
/// all ranks when memory runs out.
void factorise_fronts(const Plan& plan, const la::Pencil& pencil, double sigma, Numbers& numbers, Workspace& workspace);

}  // namespace carillon::ldlt

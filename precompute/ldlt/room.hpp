// The memory in which a rank makes its own fronts, and the pivot columns of shared ones.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/ldlt/node_links.hpp"

namespace carillon::ldlt {

struct DealtFront;
struct Front;

/// Offsets in doubles from the first panel: panels fill the memory from below, and what they have not filled yet holds the columns of the
/// front in work and, from above, two stacks of update matrices.
struct Room {
  std::int64_t panels = 0;               // of own and shared fronts
  std::int64_t numbers = 0;              // panels, columns and stacks
  std::int64_t stack_begin[2] = {0, 0};  // of update matrices of even and odd depth; stacks grow downwards
  int solve_blocks = 0;                  // of right-hand sides that lie after the panels in the solves, from solve_begin() on

  std::int64_t solve_begin() const { return (panels + 7) / 8 * 8; }  // aligned for vectors
};

/// The least room for own fronts in this order, and for the pivot columns of shared ones, which become their panels. At most `blocks` of
/// right-hand sides of `block` numbers are put where there is room for them.
Room plan_room(const std::vector<Front>& fronts, std::int64_t shared_columns, int blocks, std::int64_t block);

/// Sorts a rank's own fronts, given as places in `dealt`, where children come before parents: the children of each, and the roots, in the
/// order in which panels and update matrices take least room together, those first that need most room above what they leave. Source: Liu
/// 1986.
void sort_by_room(const std::vector<DealtFront>& dealt, std::vector<Ints>& children, Ints& roots);

}  // namespace carillon::ldlt

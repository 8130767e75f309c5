// Memory layout for own fronts and the pivot columns of shared ones.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/ldlt/node_links.hpp"

namespace carillon::ldlt {

struct DealtFront;
struct Front;

/// Offsets in doubles from the first panel: panels fill the memory from below; the rest holds the columns of the current front and, from
/// above, two stacks of contribution blocks.
struct Room {
  std::int64_t panels = 0;               // end of the panels of own and shared fronts
  std::int64_t numbers = 0;              // total of panels, columns and stacks
  std::int64_t stack_begin[2] = {0, 0};  // of contribution blocks of even and odd depth; stacks grow downwards
  int solve_blocks = 0;                  // blocks of right-hand sides placed behind the panels in solves, from solve_begin() on

  std::int64_t solve_begin() const { return (panels + 7) / 8 * 8; }  // aligned for vector instructions
};

/// Minimum room for own fronts in this order, and for the pivot columns of shared fronts, which become their panels. Places up to `blocks`
/// blocks of right-hand sides of `block` numbers where they fit.
Room plan_room(const std::vector<Front>& fronts, std::int64_t shared_columns, int blocks, std::int64_t block);

/// Sorts the children of each own front, and the roots, to minimise the joint peak of panels and contribution blocks: those with the
/// largest peak above their remainder first. Fronts are indices in `dealt`, where children precede parents. Source: Liu 1986.
void sort_by_room(const std::vector<DealtFront>& dealt, std::vector<Ints>& children, Ints& roots);

}  // namespace carillon::ldlt

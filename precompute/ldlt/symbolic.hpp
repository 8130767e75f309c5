// Supernodes of L and their rows. Serial, in units of nodes (three rows each).
#pragma once

#include <cstdint>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::ldlt {

/// Consecutive pivot nodes with a common list of rows below: a front of the multifrontal method.
struct Supernode {
  std::int32_t first = 0;          // first pivot
  std::int32_t width = 0;          // number of pivots
  std::int32_t parent = -1;        // supernode containing the first row; -1: no row, or the first row is a boundary vertex
  std::vector<std::int32_t> rows;  // ascending, behind the pivots
  std::int32_t size() const { return width + static_cast<std::int32_t>(rows.size()); }
};

/// Supernodes in postorder: children precede parents, and each subtree is contiguous.
struct Forest {
  std::vector<Supernode> supernodes;
  std::vector<std::int32_t> position;         // (pivots) new position of each pivot vertex
  std::vector<std::int32_t> element_parents;  // (elements) supernode containing the first row of the element, -1: none
};

/// Finds the supernodes of a graph whose vertices are in elimination order. The first `elements` vertices are elements of the quotient
/// graph: they represent subtrees eliminated elsewhere, and their neighbours form cliques. The next `pivots` are eliminated here. The
/// remaining boundary vertices are not eliminated. The result omits elements: pivot vertex elements + i becomes position[i], boundary
/// vertex elements + pivots + k becomes pivots + k. Edges between boundary vertices are ignored.
Forest find_supernodes(const partition::Graph& graph, std::int32_t elements, std::int32_t pivots);

/// Entries of L and D, and flops of the elimination, for a front of `width` pivot nodes and `size` nodes in total.
std::int64_t count_entries(std::int64_t width, std::int64_t size);
double count_flops(std::int64_t width, std::int64_t size);
/// Modelled time of a front in a factorisation and a typical number of solves [ns].
double calc_cost_ns(std::int64_t width, std::int64_t size);

}  // namespace carillon::ldlt

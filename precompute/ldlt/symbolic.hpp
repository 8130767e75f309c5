// Which columns of L are eliminated together, and which rows they fill. Serial, and in units of nodes (three rows each).
#pragma once

#include <cstdint>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::ldlt {

/// Consecutive pivot nodes with one list of rows below them: a front of the multifrontal method.
struct Supernode {
  std::int32_t first = 0;          // of its pivots
  std::int32_t width = 0;          // pivots
  std::int32_t parent = -1;        // supernode that holds the first row; -1: no row, or the first row is a boundary vertex
  std::vector<std::int32_t> rows;  // ascending, behind the pivots
  std::int32_t size() const { return width + static_cast<std::int32_t>(rows.size()); }
};

/// Supernodes in postorder: children stand before their parents, and the subtree of each is contiguous.
struct Forest {
  std::vector<Supernode> supernodes;
  std::vector<std::int32_t> position;         // (pivots) new place of each pivot vertex
  std::vector<std::int32_t> element_parents;  // (elements) the supernode that holds the element's first row, -1: none
};

/// Finds the supernodes of a graph whose vertices stand in the order of elimination. The first `elements` vertices are eliminated elements
/// of the quotient graph: they stand for subtrees eliminated elsewhere, and their neighbours form cliques. The next `pivots` are eliminated
/// here. The others, the boundary, stay. In the result elements are dropped: pivot vertex elements + i becomes position[i], boundary vertex
/// elements + pivots + k becomes pivots + k. Edges between boundary vertices are ignored.
Forest find_supernodes(const partition::Graph& graph, std::int32_t elements, std::int32_t pivots);

/// Entries kept of L and D, and flops of the elimination, of a front of `width` pivot nodes and `size` nodes in all.
std::int64_t count_entries(std::int64_t width, std::int64_t size);
double count_flops(std::int64_t width, std::int64_t size);
/// Modelled time of a front in a factorisation and the solves that usually follow it [ns].
double calc_cost_ns(std::int64_t width, std::int64_t size);

}  // namespace carillon::ldlt

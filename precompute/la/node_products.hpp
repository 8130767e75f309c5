// Inner loops of NodeMatrix, compiled for several instruction sets. Private header.
#pragma once

#include <cstddef>
#include <cstdint>

#include "precompute/la/node_matrix.hpp"

namespace carillon::la {

inline constexpr int kAhead = 4;  // blocks by which rows of x are prefetched, as their addresses are irregular

// Rows of nodes: y (3 x 16). start: (nodes + 1) into neighbour, which is padded by kAhead entries.
/// y = rest (3 x 3) times own x + sum of blocks (3 x 3) times differences from it.
void multiply_blocks(const std::int64_t* start, const std::int32_t* neighbour, const double* values, const double* rest, std::size_t nodes,
                     const NodeMatrix::Row* own_rows, const NodeMatrix::Row* x, NodeMatrix::Row* y);
/// y = sum of a value times x.
void multiply_scalars(const std::int64_t* start, const std::int32_t* neighbour, const double* values, std::size_t nodes,
                      const NodeMatrix::Row* x, NodeMatrix::Row* y);

}  // namespace carillon::la

// Sums over the rows of modes, sixteen at a time, compiled for several instruction sets. Private header.
#pragma once

#include <array>
#include <cstddef>

#include "precompute/la/node_matrix.hpp"

namespace carillon::eigen {

/// r = K phi - lambda M phi with a given lambda.
enum Sum : int { kPhiMPhi, kPhiR, kRR, kRMPhi, kMPhiMPhi, kDiagonal, kSums };
using Sums = std::array<la::NodeMatrix::Row, kSums>;

/// Adds those of `rows` rows of phi, M phi and K phi; diagonal: of K, (rows).
void add_sums(std::size_t rows, const la::NodeMatrix::Row* phi, const la::NodeMatrix::Row* m_phi, const la::NodeMatrix::Row* k_phi,
              const double* diagonal, const la::NodeMatrix::Row& lambda, Sums& total);

}  // namespace carillon::eigen

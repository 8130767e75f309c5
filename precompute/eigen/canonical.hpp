// Canonical basis of degenerate modes.
#pragma once

#include <petscmat.h>

#include <vector>

#include "precompute/eigen/check_modes.hpp"
#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// Groups of consecutive modes that agree in lambda to a quarter of the tolerance, or to the rounding of K (errors.floor), so that the
/// iteration may have mixed them. lambda: ascending. Not collective.
std::vector<Cluster> find_groups(const std::vector<double>& lambda, const ModeErrors& errors, double tolerance);

/// Separates the modes of each group as far as rounding allows and returns the remaining clusters: neighbours that agree to 1e-12 of
/// lambda, or to the rounding of K. Shapes and lambda become those of the separated modes, ascending. Collective.
std::vector<Cluster> split_clusters(const Operators& operators, const std::vector<Cluster>& groups, const ModeErrors& errors,
                                    std::vector<double>& lambda, Mat shapes);

/// Replaces the shapes of each cluster by the basis that diagonalises a fixed quadratic form of node positions, masses and displacements,
/// ascending; it depends only on the span. All modes of a cluster get its mean lambda. Collective.
void make_canonical(const Operators& operators, const NodeLayout& nodes, const std::vector<Cluster>& clusters, std::vector<double>& lambda,
                    Mat shapes);

}  // namespace carillon::eigen

// A canonical basis of degenerate modes.
#pragma once

#include <petscmat.h>

#include <vector>

#include "precompute/eigen/check_modes.hpp"
#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// Runs of modes whose neighbours agree in lambda to a quarter of the tolerance, or to what rounding of K leaves open (errors.floor): the
/// iteration may have mixed them. lambda: ascending. Not collective.
std::vector<Cluster> find_groups(const std::vector<double>& lambda, const ModeErrors& errors, double tolerance);

/// Separates the modes of every group as far as rounding allows, and returns the clusters that are left: neighbours that agree to 1e-12 of
/// lambda, or to what rounding of K leaves open. Shapes and lambda are those of the separated modes, ascending. Collective.
std::vector<Cluster> split_clusters(const Operators& operators, const std::vector<Cluster>& groups, const ModeErrors& errors,
                                    std::vector<double>& lambda, Mat shapes);

/// Replaces the shapes of every cluster by the basis that makes a fixed quadratic form of the nodes' positions, masses and displacements
/// diagonal, ascending: it depends on the span alone. All modes of a cluster get its mean lambda. Collective.
void make_canonical(const Operators& operators, const NodeLayout& nodes, const std::vector<Cluster>& clusters, std::vector<double>& lambda,
                    Mat shapes);

}  // namespace carillon::eigen

// The steps of check_mesh that have a file of their own. Inner header.
#pragma once

#include <string>
#include <vector>

#include "precompute/mesh/check.hpp"

namespace carillon::mesh {

/// The first ten of `elements` (zero-based) as the user knows them: "17, 20, 31 and 5 more (counted from 1 in the order of the file)".
std::string list_elements(const std::vector<std::int64_t>& elements);

/// Finds nodes in the same place and joins those that close a crack: the corners and mid nodes of two boundary faces that coincide.
/// Returns for every node the one that stands for it, and counts welded and touching nodes in `report`. Elements are renumbered, nodes not.
std::vector<std::int32_t> weld_cracks(TetMesh& mesh, const std::string& name, CheckReport& report);

/// Volume, box, dihedral angles and mean ratios of the straight-sided elements.
void calc_quality(const TetMesh& mesh, CheckReport& report);

/// Warns of a body of unlikely size or far from the origin, of slivers, nodes that were dropped and elements that were turned.
void warn_of_elements(CheckReport& report);

/// Counts curved quadratic elements and straightens those that fold (curved.hpp).
void straighten_folded(TetMesh& mesh, CheckReport& report);

}  // namespace carillon::mesh

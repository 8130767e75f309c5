// Steps of check_mesh in files of their own. Internal header.
#pragma once

#include <string>
#include <vector>

#include "precompute/mesh/check.hpp"

namespace carillon::mesh {

/// First ten of `elements` (zero-based) for messages: "17, 20, 31 and 5 more (counted from 1 in the order of the file)".
std::string list_elements(const std::vector<std::int64_t>& elements);

/// Finds coincident nodes and merges those that close a crack: corners and mid nodes of coincident boundary faces. Returns the
/// representative of every node; counts welded and touching nodes in `report`. Renumbers elements, not nodes.
std::vector<std::int32_t> weld_cracks(TetMesh& mesh, const std::string& name, CheckReport& report);

/// Volume, box, dihedral angles and mean ratios of the straight-sided elements.
void calc_quality(const TetMesh& mesh, CheckReport& report);

/// Warns of unlikely size, distance from the origin, slivers, dropped nodes and inverted elements.
void warn_of_elements(CheckReport& report);

/// Counts curved quadratic elements and straightens folded ones (curved.hpp).
void straighten_folded(TetMesh& mesh, CheckReport& report);

}  // namespace carillon::mesh

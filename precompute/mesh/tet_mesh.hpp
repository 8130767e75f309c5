// A tetrahedral volume mesh as it was read or made: serial, complete, in SI metres.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::mesh {

/// Linear (4 nodes) or quadratic (10 nodes) tetrahedra. Node order within an element: corners 0 1 2 3 with
/// det(x1 - x0, x2 - x0, x3 - x0) > 0, then the mid-side nodes of the edges 01, 12, 02, 03, 13, 23 (VTK's order).
struct TetMesh {
  int order = 1;                                               // 1 or 2
  std::vector<Vec3> nodes_m;                                   // (N) [m]
  std::vector<std::int32_t> tets;                              // (E, 4) or (E, 10), zero-based
  std::vector<std::int32_t> regions;                           // (E), the file's region tag, 0 where it has none
  std::map<std::int32_t, std::string> region_names;            // of the tags that the file names
  std::map<std::string, std::vector<std::int32_t>> node_sets;  // named sets of the file, ascending
  // (N) [m] of a surface whose facets may be planes or samples of a smooth surface: from each node to its place on the other of the two,
  // zero where there is no doubt. Empty: no doubt anywhere.
  std::vector<Vec3> doubt_m;

  int nodes_per_tet() const { return order == 1 ? 4 : 10; }
  std::int64_t tet_count() const { return static_cast<std::int64_t>(tets.size()) / nodes_per_tet(); }
  std::span<const std::int32_t> tet(std::int64_t e) const {
    return {tets.data() + e * nodes_per_tet(), static_cast<std::size_t>(nodes_per_tet())};
  }
};

/// What the section of a Gmsh file that keeps TetMesh::doubt_m is called.
inline constexpr const char* kDoubtName = "carillon surface doubt [m]";

/// The local corner pairs of the six edges, in the order of the mid-side nodes 4..9.
inline constexpr std::array<std::array<int, 2>, 6> kEdges{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};
/// The local corners of the four faces, counter-clockwise seen from outside; face i lies opposite corner i.
inline constexpr std::array<std::array<int, 3>, 4> kFaces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

}  // namespace carillon::mesh

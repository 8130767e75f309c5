// Tetrahedral volume mesh: serial, complete, in SI metres (as read_mesh returns it, in the unit of its file).
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::mesh {

/// Isotropic solid of a mesh file, in SI units.
struct FileMaterial {
  std::string name;
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
  double alpha1_s = 0.0, alpha2_per_s = 0.0;  // Rayleigh damping
  double loss_factor = 0.0;                   // structural damping
  std::string place;                          // "file:line"
  std::string problem;                        // why a body cannot be made of it; empty: it can
};

/// Linear (4 nodes) or quadratic (10 nodes) tetrahedra. Node order of an element: corners 0 1 2 3 with det(x1 - x0, x2 - x0, x3 - x0) > 0,
/// then the mid-side nodes of edges 01, 12, 02, 03, 13, 23 (VTK order).
struct TetMesh {
  int order = 1;                                               // 1 or 2
  std::vector<Vec3> nodes_m;                                   // (N) [m]
  std::vector<std::int32_t> tets;                              // (E, 4) or (E, 10), zero-based
  std::vector<std::int32_t> regions;                           // (E), region tag of the file, 0: none
  std::map<std::int32_t, std::string> region_names;            // of named tags
  std::map<std::string, std::vector<std::int32_t>> node_sets;  // named sets of the file, ascending
  // (N) [m] Ambiguous surfaces (facets may be planes or samples of a smooth surface): offset from each node to the alternative surface,
  // zero where unambiguous. Empty: unambiguous everywhere.
  std::vector<Vec3> doubt_m;

  // Of CAE files only.
  std::map<std::int32_t, FileMaterial> materials = {};  // by region tag
  double unit_m = 1.0;                                  // metres per unit of nodes_m
  std::string unit = {};                                // the unit and its reason; empty: metres by convention
  std::string supports = {};                            // node set of the supports of the file; empty: none
  std::vector<std::string> remarks = {};                // parts of the model that a body cannot have

  int nodes_per_tet() const { return order == 1 ? 4 : 10; }
  std::int64_t tet_count() const { return static_cast<std::int64_t>(tets.size()) / nodes_per_tet(); }
  std::span<const std::int32_t> tet(std::int64_t e) const {
    return {tets.data() + e * nodes_per_tet(), static_cast<std::size_t>(nodes_per_tet())};
  }
};

/// Section of TetMesh::doubt_m in a Gmsh file.
inline constexpr const char* kDoubtName = "carillon surface doubt [m]";

/// Local corner pairs of the six edges, in the order of mid-side nodes 4..9.
inline constexpr std::array<std::array<int, 2>, 6> kEdges{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};
/// Local corners of the four faces, counter-clockwise seen from outside; face i is opposite corner i.
inline constexpr std::array<std::array<int, 3>, 4> kFaces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

}  // namespace carillon::mesh
